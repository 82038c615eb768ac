//! Numbers as Mitsuba writes them: decimal, in lists parted by blanks or commas.

/// The words of a list.
pub(super) fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| c == ',' || c.is_ascii_whitespace()).filter(|word| !word.is_empty())
}

/// One finite number that single precision can hold.
pub(super) fn number(text: &str) -> Result<f64, String> {
    let text = text.trim_matches(|c: char| c.is_ascii_whitespace());
    let shown = super::error::excerpt(text);
    if text.is_empty() {
        return Err("a number is missing".to_owned());
    }
    // Rust's parser takes "nan", "inf" and "infinity" too; they are numbers to nobody's scene.
    if text.chars().any(|c| c.is_ascii_alphabetic() && c != 'e' && c != 'E') {
        return Err(format!("\"{shown}\" is not a number"));
    }
    let value: f64 = text.parse().map_err(|_| format!("\"{shown}\" is not a number"))?;
    if value.abs() > f64::from(f32::MAX) { Err(format!("{shown} is too large for single precision")) } else { Ok(value) }
}

/// A list of numbers; more than `most` words are an error before they are read.
pub(super) fn numbers(text: &str, most: usize) -> Result<Vec<f64>, String> {
    let mut list = Vec::with_capacity(most);
    for word in words(text) {
        if list.len() == most {
            return Err(format!("{} numbers, at most {most} expected", words(text).count()));
        }
        list.push(number(word)?);
    }
    Ok(list)
}

/// Three numbers.
pub(super) fn triple(text: &str) -> Result<[f64; 3], String> {
    match numbers(text, 3)?[..] {
        [x, y, z] => Ok([x, y, z]),
        ref list => Err(format!("{} numbers, 3 expected", list.len())),
    }
}

/// Three numbers, or one that stands for all three.
pub(super) fn one_or_three(text: &str) -> Result<[f64; 3], String> {
    match numbers(text, 3)?[..] {
        [v] => Ok([v; 3]),
        [x, y, z] => Ok([x, y, z]),
        ref list => Err(format!("{} numbers, one or three expected", list.len())),
    }
}

/// A whole number.
pub(super) fn integer(text: &str) -> Result<i64, String> {
    let text = text.trim_matches(|c: char| c.is_ascii_whitespace());
    text.parse().map_err(|_| format!("\"{}\" is not an integer", super::error::excerpt(text)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_parted_by_blanks_or_commas() {
        for text in ["1 2 3", "1,2,3", " 1, 2 ,3 ", "1\t2\n3", "+1 2. 30e-1"] {
            assert_eq!(triple(text), Ok([1.0, 2.0, 3.0]), "{text:?}");
        }
        assert_eq!(one_or_three("0.5"), Ok([0.5; 3]));
    }

    #[test]
    fn what_is_no_number_is_refused() {
        for text in ["", "nan", "inf", "-infinity", "1e", "0x10", "1e39", "1f", "--1", "1.2.3", "\u{661}"] {
            assert!(number(text).is_err(), "{text:?}");
        }
        assert!(triple("1 2").is_err());
        assert!(numbers("1 2 3 4", 3).is_err());
        assert!(integer("1.0").is_err() && integer("99999999999999999999").is_err());
    }
}
