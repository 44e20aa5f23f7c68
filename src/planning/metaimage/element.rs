//! Value types.

/// A value type, by its size in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Element {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// MetaIO's type names. `MET_LONG` has four bytes in MetaIO on every machine. Older programs append
/// `_ARRAY` to the name if there is more than one channel.
const NAMES: [(&str, Element); 12] = [
    ("MET_CHAR", Element::I8),
    ("MET_UCHAR", Element::U8),
    ("MET_SHORT", Element::I16),
    ("MET_USHORT", Element::U16),
    ("MET_INT", Element::I32),
    ("MET_UINT", Element::U32),
    ("MET_LONG", Element::I32),
    ("MET_ULONG", Element::U32),
    ("MET_LONG_LONG", Element::I64),
    ("MET_ULONG_LONG", Element::U64),
    ("MET_FLOAT", Element::F32),
    ("MET_DOUBLE", Element::F64),
];

/// Allowed types, for messages.
pub(super) const ALLOWED: &str = "MET_CHAR, MET_UCHAR, MET_SHORT, MET_USHORT, MET_INT, MET_UINT, \
     MET_LONG, MET_ULONG, MET_LONG_LONG, MET_ULONG_LONG, MET_FLOAT or MET_DOUBLE";

impl Element {
    pub(super) fn named(name: &str) -> Option<Self> {
        let plain = name.strip_suffix("_ARRAY").unwrap_or(name);
        let known = NAMES.iter().find(|(known, _)| *known == plain);
        known.map(|&(_, element)| element)
    }

    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// Appends all values of type `$kind` in `$bytes`, each cast with `as`.
macro_rules! append {
    ($kind:ty, $bytes:expr, $big:expr, $to:expr, $out:ty) => {{
        let (words, _) = $bytes.as_chunks::<{ size_of::<$kind>() }>();
        if $big {
            $to.extend(words.iter().map(|&w| <$kind>::from_be_bytes(w) as $out));
        } else {
            $to.extend(words.iter().map(|&w| <$kind>::from_le_bytes(w) as $out));
        }
    }};
}

impl Element {
    /// Appends integer values, all of which must fit.
    pub(super) fn append_i16(self, bytes: &[u8], big: bool, to: &mut Vec<i16>) {
        match self {
            Self::I8 => append!(i8, bytes, big, to, i16),
            Self::U8 => append!(u8, bytes, big, to, i16),
            Self::I16 => append!(i16, bytes, big, to, i16),
            _ => unreachable!("other kinds are read as f32"),
        }
    }

    /// Appends values, each rounded to the nearest `f32`.
    pub(super) fn append_f32(self, bytes: &[u8], big: bool, to: &mut Vec<f32>) {
        match self {
            Self::I8 => append!(i8, bytes, big, to, f32),
            Self::U8 => append!(u8, bytes, big, to, f32),
            Self::I16 => append!(i16, bytes, big, to, f32),
            Self::U16 => append!(u16, bytes, big, to, f32),
            Self::I32 => append!(i32, bytes, big, to, f32),
            Self::U32 => append!(u32, bytes, big, to, f32),
            Self::I64 => append!(i64, bytes, big, to, f32),
            Self::U64 => append!(u64, bytes, big, to, f32),
            Self::F32 => append!(f32, bytes, big, to, f32),
            Self::F64 => append!(f64, bytes, big, to, f32),
        }
    }
}
