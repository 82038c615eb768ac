"""Plants a fault for every assertion of check.py into copies of a page and sees that assertion fail: faults.py PAGE.html"""
import argparse
import contextlib
import io
import json
import pathlib
import shutil
import sys
import tempfile

from playwright.sync_api import sync_playwright

import check

CHART = '<svg role="img" viewBox="0 0 9 9" width="90" height="90"><title>errors</title><g data-series="a"></g><g data-series="b"></g></svg>'


def added(html):
    """Before the page's end."""
    return lambda page: page.replace("</body>", html + "</body>")


def replaced(old, new):
    def change(page):
        assert old in page, f"the page has no {old!r} to replace"
        return page.replace(old, new)
    return change


def ignored(key):
    return added(f"<script>addEventListener('keydown', e => {{ if (e.key === '{key}') e.stopImmediatePropagation(); }}, true);</script>")


# What is done to the page, and what part of the name of a check has to fail.
FAULTS = [
    (added("<script>console.warn('a warning')</script>"), "console is silent"),
    (added("<script>setTimeout(() => { throw new Error('late') }, 50)</script>"), "console is silent"),
    (added('<img alt="" src="http://127.0.0.1:9/a.png">'), "no request leaves the file"),
    (added("<script>fetch('other.json').catch(() => 0)</script>"), "no request leaves the file"),
    (added('<link rel="stylesheet" href="style.css">'), "no request leaves the file"),
    (ignored("2"), "key 2 shows another picture"),
    (ignored("1"), "key 1 brings the first back"),
    (ignored("ArrowLeft"), "the arrows flip as well"),
    (ignored("E"), "e and E change the exposure"),
    (ignored("f"), "zoom, pan and fit"),
    (ignored("m"), "m goes through four modes"),
    (ignored("c"), "a drawn crop appears"),
    (replaced("viewer.step(right < 0 ? 1 : -1);", ""), "a swipe flips"),
    (replaced('data-viewer="picture">', 'data-viewer="picture">AAAA'), "is unpacked"),
    (added("<style>*:focus { outline: none !important; }</style>"), "shows its focus"),
    (added('<div style="width:361px;height:2px"></div>'), "nothing is wider than 360 px"),
    (added("<button></button>"), "every control has a name"),
    (replaced("prefers-color-scheme: dark", "prefers-color-scheme: none"), "dark is dark"),
    (added("<style>body { color: #999; }</style>"), "text stands out, desktop"),
    (replaced(CHART, CHART.replace('<g data-series="b"></g>', "")), "has its 2 series"),
    (replaced(CHART, ""), "there are charts"),
]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("page", type=pathlib.Path)
    arguments = parser.parse_args()
    sound = added(CHART)(arguments.page.read_text())
    missed = []
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = pathlib.Path(name)
        cells = [{"kind": "cell", "method": method, "status": status} for method, status in [("a", "done"), ("b", "done"), ("c", "failed")]]
        (folder / "records.jsonl").write_text("".join(json.dumps(cell) + "\n" for cell in cells))
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])

        def failures(run):
            told = io.StringIO()
            with contextlib.redirect_stdout(told):
                failed = run()
            return failed, told.getvalue()

        page = folder / "page.html"
        for change, expected in [(lambda html: html, None), *FAULTS]:
            page.write_text(change(sound))
            failed, _ = failures(lambda: check.check_page(browser, page, folder / "records.jsonl", folder))
            good = not failed if expected is None else any(expected in what for what in failed)
            print(f"{'seen  ' if good else 'MISSED'} {expected or 'nothing wrong'}: {failed}", flush=True)
            missed += [] if good else [expected]
        section = sound[sound.index("<section class=\"viewer\"") : sound.index("</section>") + len("</section>")]
        several = sound.replace(section, "".join(section.replace("pictures", f"scene{i}") for i in range(4)))
        for change, eager in [(lambda html: html, False), (replaced('rootMargin: "300px"', 'rootMargin: "99999px"'), True)]:
            page.write_text(change(several))
            failed, _ = failures(lambda: check.check_speed(browser, page))
            good = ("viewers out of sight wait" in failed) == eager
            print(f"{'seen  ' if good else 'MISSED'} viewers out of sight {'unpacked' if eager else 'wait'}: {failed}")
            missed += [] if good else ["eager"]
        page.write_text(added("<script>{ const end = performance.now() + 2100; while (performance.now() < end); }</script>")(sound))
        failed, _ = failures(lambda: check.check_speed(browser, page))
        print(f"{'seen  ' if failed else 'MISSED'} slow: {failed}")
        missed += [] if failed else ["slow"]
        browser.close()
    print(f"{len(missed)} faults not seen" if missed else "every fault seen")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
