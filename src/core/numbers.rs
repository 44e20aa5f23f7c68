//! Deserialises number lists of a fixed length (positions, ranges, lens coefficients) from files
//! and requests. A list of the wrong length is rejected with both counts; serde's own arrays ignore
//! surplus elements.

use glam::{DMat3, DVec2, DVec3};
use serde::de::{DeserializeOwned, Error, IgnoredAny, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::marker::PhantomData;

/// A type built from a list of fixed length.
pub trait Fixed: Sized {
    /// Type of a list element.
    type Entry: DeserializeOwned;
    /// Number of elements.
    const COUNT: usize;
    /// Noun for the elements in messages, singular and plural.
    const NAMES: [&'static str; 2] = ["number", "numbers"];

    /// Builds the value from exactly [`Self::COUNT`] elements.
    fn from_list(list: Vec<Self::Entry>) -> Self;
}

impl<const N: usize> Fixed for [f64; N] {
    type Entry = f64;
    const COUNT: usize = N;

    fn from_list(list: Vec<f64>) -> Self {
        std::array::from_fn(|i| list[i])
    }
}

impl Fixed for DVec2 {
    type Entry = f64;
    const COUNT: usize = 2;

    fn from_list(list: Vec<f64>) -> Self {
        Self::from_slice(&list)
    }
}

impl Fixed for DVec3 {
    type Entry = f64;
    const COUNT: usize = 3;

    fn from_list(list: Vec<f64>) -> Self {
        Self::from_slice(&list)
    }
}

/// A matrix is a list of three rows.
impl Fixed for DMat3 {
    type Entry = Listed<[f64; 3]>;
    const COUNT: usize = 3;
    const NAMES: [&'static str; 2] = ["row", "rows"];

    fn from_list(list: Vec<Listed<[f64; 3]>>) -> Self {
        let row = |i: usize| list[i].0;
        Self::from_cols_array_2d(&[row(0), row(1), row(2)]).transpose()
    }
}

/// Deserialises a list of exactly [`Fixed::COUNT`] elements; for `deserialize_with`.
///
/// # Errors
/// Returns an error if the value is not a list of such elements or has another length.
pub fn exactly<'de, D: Deserializer<'de>, T: Fixed>(from: D) -> Result<T, D::Error> {
    from.deserialize_seq(List(PhantomData))
}

/// Like [`exactly`], for an optional list; combine with `#[serde(default)]`.
///
/// # Errors
/// Returns the errors of [`exactly`].
pub fn exactly_if_any<'de, D: Deserializer<'de>, T: Fixed>(from: D) -> Result<Option<T>, D::Error> {
    Ok(Option::<Listed<T>>::deserialize(from)?.map(|listed| listed.0))
}

/// Deserialises a list of at most `MAX` elements, and stops at the first surplus element; for
/// `deserialize_with`.
///
/// # Errors
/// Returns an error if the value is not a list of such elements or has more than `MAX` elements.
pub fn at_most<'de, D: Deserializer<'de>, T: Deserialize<'de>, const MAX: usize>(
    from: D,
) -> Result<Vec<T>, D::Error> {
    from.deserialize_seq(AtMost::<T, MAX>(PhantomData))
}

struct AtMost<T, const MAX: usize>(PhantomData<T>);

impl<'de, T: Deserialize<'de>, const MAX: usize> Visitor<'de> for AtMost<T, MAX> {
    type Value = Vec<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list: [[...]] for tables, [...] for values")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<T>, A::Error> {
        let mut taken = Vec::new();
        while let Some(entry) = list.next_element()? {
            if taken.len() == MAX {
                return Err(A::Error::custom(format!(
                    "a list of more than {MAX}; expected at most {MAX}"
                )));
            }
            taken.push(entry);
        }
        Ok(taken)
    }
}

/// Wrapper that deserialises with [`exactly`].
pub struct Listed<T>(T);

impl<'de, T: Fixed> Deserialize<'de> for Listed<T> {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        exactly(from).map(Self)
    }
}

struct List<T>(PhantomData<T>);

impl<'de, T: Fixed> Visitor<'de> for List<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "a list of {} {}", T::COUNT, T::NAMES[1])
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<T, A::Error> {
        let mut taken = Vec::with_capacity(T::COUNT);
        while taken.len() < T::COUNT
            && let Some(entry) = list.next_element()?
        {
            taken.push(entry);
        }
        let mut count = taken.len();
        if count == T::COUNT {
            while list.next_element::<IgnoredAny>()?.is_some() {
                count += 1;
            }
        }
        if count == T::COUNT {
            return Ok(T::from_list(taken));
        }
        let name = T::NAMES[usize::from(count != 1)];
        Err(A::Error::custom(format!(
            "a list of {count} {name}; expected {}",
            T::COUNT
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::TomlSource;

    #[derive(Debug, PartialEq, Deserialize)]
    struct Lists {
        #[serde(deserialize_with = "exactly")]
        two: [f64; 2],
        #[serde(default, deserialize_with = "exactly_if_any")]
        three: Option<DVec3>,
        #[serde(default = "identity", deserialize_with = "exactly")]
        rows: DMat3,
        #[serde(default, deserialize_with = "at_most::<_, _, 3>")]
        few: Vec<f64>,
    }

    fn identity() -> DMat3 {
        DMat3::IDENTITY
    }

    fn read(text: &str) -> crate::error::Result<Lists> {
        TomlSource::new(text, "file.toml").deserialize()
    }

    #[test]
    fn accepts_lists_of_the_right_length() {
        let rows = "rows = [[1, 2, 3], [4, 5, 6], [7, 8, 9]]";
        let lists = read(&format!("two = [1, 2.5]\nthree = [3, 4, 5]\n{rows}\n")).unwrap();
        assert_eq!(lists.two, [1.0, 2.5]);
        assert_eq!(lists.three, Some(DVec3::new(3.0, 4.0, 5.0)));
        assert_eq!(lists.rows.row(1), DVec3::new(4.0, 5.0, 6.0));
        assert_eq!(read("two = [0, 0]").unwrap().three, None);
    }

    #[test]
    fn refuses_lists_of_other_lengths_with_line_and_counts() {
        for (text, words) in [
            (
                "\ntwo = [1]",
                "file.toml:2: two: a list of 1 number; expected 2",
            ),
            (
                "two = []",
                "file.toml:1: two: a list of 0 numbers; expected 2",
            ),
            (
                "two = [1, 2]\nthree = [\n1, 2, 3, 4]",
                "file.toml:2: three: a list of 4 numbers; expected 3",
            ),
            (
                "two = [1, 2]\nrows = [[1, 0, 0], [0, 1, 0]]",
                "file.toml:2: rows: a list of 2 rows; expected 3",
            ),
            (
                "two = [1, 2]\nrows = [[1, 0, 0], [0, 1, 0, 0], [0, 0, 1]]",
                "file.toml:2: rows[1]: a list of 4 numbers; expected 3",
            ),
        ] {
            assert_eq!(read(text).unwrap_err().to_string(), words, "{text}");
        }
        let long = format!("two = [{}]", "0,".repeat(100_000));
        let words = read(&long).unwrap_err().to_string();
        assert!(words.contains("100000 numbers"), "{words}");
        assert_eq!(read("two = [1, 2]\nfew = [1, 2, 3]").unwrap().few.len(), 3);
        let words = read("two = [1, 2]\nfew = [1, 2, 3, 4]").unwrap_err();
        assert_eq!(
            words.to_string(),
            "file.toml:2: few: a list of more than 3; expected at most 3"
        );
        let words = read("two = 1").unwrap_err().to_string();
        assert!(words.contains("a list of 2 numbers"), "{words}");
    }
}
