//! Names for contents.

use serde_json::Value;
use sha2::{Digest, Sha256};

/// Letters of a hash in a file's name: 64 bits, enough for the files of a folder.
const IN_NAMES: usize = 16;

/// SHA-256 in lower-case hexadecimal.
pub fn of_bytes(parts: &[&[u8]]) -> String {
    let mut hasher = Sha256::new();
    for part in parts {
        // Each part by its own digest, so that the joint between two cannot move unnoticed.
        hasher.update(Sha256::digest(part));
    }
    hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Of a JSON value as it is printed, keys in their order.
pub fn of_json(value: &Value) -> String {
    of_bytes(&[value.to_string().as_bytes()])
}

/// The start of a hash, for names of files.
pub fn short(hash: &str) -> &str {
    hash.get(..IN_NAMES).unwrap_or(hash)
}

/// A name as a folder or file may be called: what is safe stays, and what had to change gets a few letters of its hash, so that two names never
/// meet.
pub fn file_name(name: &str) -> String {
    const LONGEST: usize = 60;
    let safe = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    let mut plain: String = name.chars().map(safe).take(LONGEST).collect();
    let hidden = plain.starts_with('.');
    if plain == name && !hidden {
        return plain;
    }
    while plain.contains("--") {
        plain = plain.replace("--", "-");
    }
    let hash = of_bytes(&[name.as_bytes()]);
    format!("{}-{}", plain.trim_start_matches('.').trim_end_matches('-'), hash.get(..6).unwrap_or(&hash))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_safe_and_never_meet() {
        assert_eq!(file_name("glass-box"), "glass-box");
        let names = ["a b", "a-b", "a/b", "..", ".", "../a", "é", "a b ", "A b", &"x".repeat(100), &"x".repeat(99)];
        let files: std::collections::BTreeSet<String> = names.iter().map(|n| file_name(n)).collect();
        assert_eq!(files.len(), names.len(), "{files:?}");
        for file in files {
            assert!(!file.starts_with('.') && !file.contains('/') && file.len() < 80, "{file}");
        }
    }

    #[test]
    fn hashes_tell_the_joint() {
        assert_ne!(of_bytes(&[b"ab", b"c"]), of_bytes(&[b"a", b"bc"]));
        assert_eq!(short(&of_bytes(&[])).len(), 16);
    }
}
