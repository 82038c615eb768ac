//! Path classes in Heckbert's letters \[HECKBERT90\]: `L` the light, `D` a diffuse event, `G` a glossy one, `S` a delta, `E` the eye.

use regex::Regex;

/// The events of a path so far, from the eye. Paths longer than the buffer keep their last letters out and match nothing.
#[derive(Clone, Debug)]
pub struct PathClass {
    letters: [u8; MAX],
    length: usize,
}

/// Events kept.
const MAX: usize = 128;

impl Default for PathClass {
    fn default() -> Self {
        Self { letters: [0; MAX], length: 0 }
    }
}

impl PathClass {
    /// Adds an event on the light's side.
    pub fn push(&mut self, letter: u8) {
        if let Some(place) = self.letters.get_mut(self.length) {
            *place = letter;
        }
        self.length += 1;
    }

    /// Takes the last event back.
    pub fn pop(&mut self) {
        self.length = self.length.saturating_sub(1);
    }

    /// Does the whole class, from the light, match?
    pub fn matches(&self, pattern: &Regex) -> bool {
        self.join(&[], pattern)
    }

    /// Does the class match whose light-side events are `light` (from the light) and whose camera-side events are these?
    pub fn join(&self, light: &[u8], pattern: &Regex) -> bool {
        let mut class = String::with_capacity(light.len() + self.length + 2);
        class.push('L');
        class.extend(light.iter().map(|&c| char::from(c)));
        let Some(letters) = self.letters.get(..self.length) else { return false };
        class.extend(letters.iter().rev().map(|&c| char::from(c)));
        class.push('E');
        pattern.is_match(&class)
    }
}

/// The events of a path that goes from one end to somewhere on the way, in four words: what a stored vertex can afford. The first event
/// is the one next to the end the path came from. Longer ones keep count alone and match nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Letters {
    /// Two bits an event, the first one lowest.
    bits: u128,
    length: u8,
}

/// Letters by the number that stands for them.
const LETTERS: [u8; 3] = [b'D', b'G', b'S'];

impl Letters {
    /// Events kept.
    const MAX: u8 = 64;

    /// One more event.
    #[must_use]
    pub fn then(self, letter: u8) -> Self {
        let number = LETTERS.iter().position(|&l| l == letter).unwrap_or(0) as u128;
        let bits = if self.length < Self::MAX { self.bits | number << (2 * self.length) } else { self.bits };
        Self { bits, length: self.length.saturating_add(1) }
    }

    /// The letters, first event first.
    fn iter(self) -> impl DoubleEndedIterator<Item = u8> {
        (0..self.length.min(Self::MAX)).map(move |i| LETTERS[(self.bits >> (2 * i) & 3) as usize])
    }

    /// Does the class match whose events are these, then the letters of `middle`, then `camera`'s? `self` is from the light, `camera` from the camera.
    pub fn join(self, middle: &[u8], camera: Letters, pattern: &Regex) -> bool {
        if self.length > Self::MAX || camera.length > Self::MAX {
            return false;
        }
        let mut class = String::with_capacity(2 + middle.len() + usize::from(self.length + camera.length));
        class.push('L');
        class.extend(self.iter().chain(middle.iter().copied()).chain(camera.iter().rev()).map(char::from));
        class.push('E');
        pattern.is_match(&class)
    }
}

/// A pattern for whole classes, such as `LS+DE`.
pub fn pattern(text: &str) -> Result<Regex, regex::Error> {
    Regex::new(&format!("^(?:{text})$"))
}

/// A [`pattern`] as it was typed.
pub fn typed(pattern: &Regex) -> &str {
    let whole = pattern.as_str();
    whole.strip_prefix("^(?:").and_then(|rest| rest.strip_suffix(")$")).unwrap_or(whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_read_from_the_light() {
        let mut class = PathClass::default();
        assert!(class.matches(&pattern("LE").unwrap()));
        class.push(b'S');
        class.push(b'D');
        assert!(class.matches(&pattern("LDSE").unwrap()));
        assert!(!class.matches(&pattern("LD").unwrap()), "patterns are for whole classes");
        assert!(class.join(b"SS", &pattern("LS+DSE").unwrap()));
        class.pop();
        assert!(class.matches(&pattern("LS?E").unwrap()));
        assert_eq!(typed(&pattern("LD|LS+DE").unwrap()), "LD|LS+DE");
    }

    #[test]
    fn letters_join_from_both_ends() {
        let of = |text: &str| text.bytes().fold(Letters::default(), Letters::then);
        assert!(of("").join(b"", of(""), &pattern("LE").unwrap()));
        assert!(of("SG").join(b"D", of("SD"), &pattern("LSGDDSE").unwrap()));
        assert!(!of("SG").join(b"D", of("SD"), &pattern("LSGDSDE").unwrap()));
        let (most, more) = ("S".repeat(64), "S".repeat(65));
        assert!(of(&most).join(b"", of(&most), &pattern("LS{128}E").unwrap()));
        assert!(!of(&more).join(b"", of(""), &pattern("LS*E").unwrap()));
    }
}
