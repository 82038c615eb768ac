#!/usr/bin/env bash
# Pages in headless Chromium: run.sh [STUDY_FOLDER/report.html...] [--big PAGE.html]
set -euo pipefail
cd "$(dirname "$0")/../.."
if ! command -v chromium > /dev/null; then
    { apt-get update -qq && apt-get install -y -qq chromium; } > /dev/null
fi
[ -x target/venv/bin/python ] || python3 -m venv target/venv
target/venv/bin/pip install --quiet --disable-pip-version-check -r tests/browser/requirements.txt
target/venv/bin/python tests/browser/pages.py target/release/isophote target/browser
target/venv/bin/python tests/browser/check.py target/browser/compare.html "$@"
