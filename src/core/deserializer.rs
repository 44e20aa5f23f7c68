//! Deserialises TOML values. In contrast to the deserialiser of the crate `toml`, an error about a list
//! element has the position of that element, and a list is not accepted in place of a table.

use serde::de::value::StrDeserializer;
use serde::de::{
    DeserializeSeed, EnumAccess, Error, Expected, IntoDeserializer, MapAccess, SeqAccess,
    Unexpected, VariantAccess, Visitor,
};
use serde::{Deserializer, forward_to_deserialize_any};
use std::borrow::Cow;
use std::fmt;
use std::ops::Range;
use toml::Spanned;
use toml::de::DeValue;

/// An error in a document, with serde's message.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Fault {
    pub message: String,
    span: Option<Range<usize>>,
    /// Whether the error concerns a list as a whole. If so, `span` is the list's position, or, for
    /// a list of `[[tables]]`, the position of its first element.
    pub is_of_list: bool,
}

impl Fault {
    /// Returns the position of the value or the key.
    pub fn span(&self) -> Range<usize> {
        self.span.clone().unwrap_or_default()
    }

    fn at(mut self, span: &Range<usize>) -> Self {
        self.span.get_or_insert_with(|| span.clone());
        self
    }

    fn at_list(mut self, span: &Range<usize>) -> Self {
        self.is_of_list |= self.span.is_none();
        self.at(span)
    }
}

impl Error for Fault {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self {
            message: message.to_string(),
            span: None,
            is_of_list: false,
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Fault {}

/// A value with its position.
pub(crate) struct Value<'a>(pub Spanned<DeValue<'a>>);

impl<'de> Deserializer<'de> for Value<'de> {
    type Error = Fault;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        let span = self.0.span();
        let read = match self.0.into_inner() {
            DeValue::String(Cow::Borrowed(text)) => visitor.visit_borrowed_str(text),
            DeValue::String(Cow::Owned(text)) => visitor.visit_string(text),
            DeValue::Boolean(value) => visitor.visit_bool(value),
            DeValue::Integer(value) => {
                let (digits, radix) = (value.as_str(), value.radix());
                match i64::from_str_radix(digits, radix) {
                    Ok(value) => visitor.visit_i64(value),
                    Err(_) => match u64::from_str_radix(digits, radix) {
                        Ok(value) => visitor.visit_u64(value),
                        Err(_) => Err(refused(Unexpected::Other(digits), &visitor)),
                    },
                }
            }
            DeValue::Float(value) => match value.as_str().parse::<f64>() {
                // A number that is too large for f64 is parsed as infinity; reject it.
                Ok(number) if !number.is_infinite() || value.as_str().contains("inf") => {
                    visitor.visit_f64(number)
                }
                _ => Err(refused(Unexpected::Other(value.as_str()), &visitor)),
            },
            DeValue::Datetime(_) => Err(refused(Unexpected::Other("date or time"), &visitor)),
            DeValue::Array(list) => {
                let read = match is_table(&visitor) {
                    true => Err(refused(Unexpected::Seq, &"a table")),
                    false => visitor.visit_seq(Elements(list.into_iter())),
                };
                read.map_err(|fault: Fault| fault.at_list(&span))
            }
            DeValue::Table(table) => visitor.visit_map(Fields {
                fields: table.into_iter(),
                value: None,
            }),
        };
        read.map_err(|fault: Fault| fault.at(&span))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        let span = self.0.span();
        visitor.visit_some(self).map_err(|fault| fault.at(&span))
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Fault> {
        let span = self.0.span();
        let read = visitor.visit_newtype_struct(self);
        read.map_err(|fault| fault.at(&span))
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        names: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        let span = self.0.span();
        let one_of = || {
            let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
            format!("exactly one of {}", names.join(", "))
        };
        let read = match self.0.into_inner() {
            DeValue::String(name) => visitor.visit_enum(name.as_ref().into_deserializer()),
            DeValue::Table(table) if table.len() == 1 => match table.into_iter().next() {
                Some(entry) => visitor.visit_enum(Variant(entry.0, entry.1)),
                None => Err(Fault::custom(one_of())),
            },
            DeValue::Table(table) => {
                let given: Vec<_> = table.keys().map(|key| format!("`{key}`")).collect();
                let found = match given.is_empty() {
                    true => "an empty table".to_owned(),
                    false => given.join(" and "),
                };
                Err(Fault::custom(format!("{found}; expected {}", one_of())))
            }
            other => {
                let found = format!("{} {}", article(&other), type_name(&other));
                Err(Fault::custom(format!("{found}; expected {}", one_of())))
            }
        };
        read.map_err(|fault: Fault| fault.at(&span))
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        match self.0.get_ref() {
            DeValue::Array(_) => {
                let fault: Fault = refused(Unexpected::Seq, &"a table");
                Err(fault.at_list(&self.0.span()))
            }
            _ => self.deserialize_any(visitor),
        }
    }

    forward_to_deserialize_any! {
        bool u8 u16 u32 u64 u128 i8 i16 i32 i64 i128 f32 f64 char str string seq bytes byte_buf map unit
        ignored_any unit_struct tuple_struct tuple identifier
    }
}

/// Returns the indefinite article of a type's name.
pub(crate) fn article(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::Integer(_) => "an",
        _ => "a",
    }
}

/// Returns the name of a value's type.
pub(crate) fn type_name(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::Array(_) => "list",
        DeValue::Float(_) => "number",
        DeValue::Datetime(_) => "date or time",
        other => other.type_str(),
    }
}

fn refused(found: Unexpected<'_>, expected: &dyn Expected) -> Fault {
    Fault::invalid_type(found, expected)
}

/// Returns whether a visitor expects a table. Without this check, serde would also accept a list
/// and take its elements as the fields in order.
fn is_table(visitor: &dyn Expected) -> bool {
    visitor.to_string().starts_with("internally tagged enum")
}

struct Elements<'a>(<toml::de::DeArray<'a> as IntoIterator>::IntoIter);

impl<'de> SeqAccess<'de> for Elements<'de> {
    type Error = Fault;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Fault> {
        let Some(value) = self.0.next() else {
            return Ok(None);
        };
        let span = value.span();
        let read = seed.deserialize(Value(value));
        read.map(Some).map_err(|fault| fault.at(&span))
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.0.len())
    }
}

struct Fields<'a> {
    fields: <toml::de::DeTable<'a> as IntoIterator>::IntoIter,
    value: Option<Spanned<DeValue<'a>>>,
}

fn key_of<'de, T: DeserializeSeed<'de>>(
    key: &Spanned<Cow<'_, str>>,
    seed: T,
) -> Result<T::Value, Fault> {
    let name: StrDeserializer<'_, Fault> = key.get_ref().as_ref().into_deserializer();
    seed.deserialize(name)
        .map_err(|fault| fault.at(&key.span()))
}

impl<'de> MapAccess<'de> for Fields<'de> {
    type Error = Fault;

    fn next_key_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Fault> {
        let Some((key, value)) = self.fields.next() else {
            return Ok(None);
        };
        self.value = Some(value);
        key_of(&key, seed).map(Some)
    }

    fn next_value_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<T::Value, Fault> {
        let value = self.value.take();
        let value = value.ok_or_else(|| Fault::custom("a value before its key"))?;
        let span = value.span();
        seed.deserialize(Value(value))
            .map_err(|fault| fault.at(&span))
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.fields.len())
    }
}

/// A variant of an enumeration as `{ name = content }`.
struct Variant<'a>(Spanned<Cow<'a, str>>, Spanned<DeValue<'a>>);

impl<'de> EnumAccess<'de> for Variant<'de> {
    type Error = Fault;
    type Variant = Content<'de>;

    fn variant_seed<T: DeserializeSeed<'de>>(
        self,
        seed: T,
    ) -> Result<(T::Value, Self::Variant), Fault> {
        Ok((key_of(&self.0, seed)?, Content(self.1)))
    }
}

struct Content<'a>(Spanned<DeValue<'a>>);

impl<'de> VariantAccess<'de> for Content<'de> {
    type Error = Fault;

    fn unit_variant(self) -> Result<(), Fault> {
        let fault = Fault::custom("a table; expected a name in quotes");
        Err(fault.at(&self.0.span()))
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, Fault> {
        let span = self.0.span();
        seed.deserialize(Value(self.0))
            .map_err(|fault| fault.at(&span))
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, Fault> {
        Value(self.0).deserialize_seq(visitor)
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        Value(self.0).deserialize_struct("", fields, visitor)
    }
}
