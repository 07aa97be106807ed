//! JSON Schemas (draft 2020-12) of the files that people write, made of the types that read them.

use schemars::transform::{RecursiveTransform, Transform};
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde_json::{Value, json};

/// The schema of the files that `T` reads, with a title and a description.
pub fn of<T: JsonSchema>(title: &str, about: &str) -> Schema {
    let mut schema = SchemaGenerator::default().into_root_schema_for::<T>();
    schema.insert("title".to_owned(), title.into());
    schema.insert("description".to_owned(), about.into());
    RecursiveTransform(plain).transform(&mut schema);
    schema
}

/// Requires no key of the table at `place`, a pointer into `schema`, and of the tables in it: other parts of the file may give them.
pub fn require_nothing(schema: &mut Schema, place: &str) {
    let Some(Value::Object(table)) = schema.pointer_mut(place) else { return };
    table.remove("required");
    let keys = table.get("properties").and_then(Value::as_object);
    let forms =
        |key: &Value| [key.clone()].into_iter().chain(key["anyOf"].as_array().cloned().unwrap_or_default());
    let inner = keys.into_iter().flat_map(|keys| keys.values().flat_map(forms));
    let inner: Vec<_> =
        inner.filter_map(|form| Some(form["$ref"].as_str()?.trim_start_matches('#').to_owned())).collect();
    for place in &inner {
        require_nothing(schema, place);
    }
}

/// Takes away what TOML does not have (`null`), what no editor shows (formats, defaults of whole tables), and all but the first paragraph of a
/// description.
fn plain(schema: &mut Schema) {
    let Some(schema) = schema.as_object_mut() else { return };
    schema
        .retain(|key, value| key != "format" && (key != "default" || !value.is_null() && !value.is_object()));
    if let Some(Value::String(text)) = schema.get_mut("description") {
        let first = text.split("\n\n").next().unwrap_or_default();
        *text = first.replace('\n', " ").replace("[`", "`").replace("`]", "`");
    }
    let null = json!("null");
    if let Some(Value::Array(names)) = schema.get_mut("type") {
        names.retain(|name| *name != null);
        let only = names.first().cloned().filter(|_| names.len() == 1);
        only.map(|only| schema.insert("type".to_owned(), only));
    }
    let Some(Value::Array(forms)) = schema.get_mut("anyOf") else { return };
    forms.retain(|form| form.get("type") != Some(&null));
    if let [Value::Object(only)] = &mut forms[..] {
        let mut only = std::mem::take(only);
        schema.remove("anyOf");
        // the description of the key comes before that of its type
        only.append(schema);
        *schema = only;
    }
}

/// Gives all numbers in `schema` these bounds.
fn bound(schema: &mut Schema, [least, most]: [f64; 2]) {
    let mut of_numbers = RecursiveTransform(|schema: &mut Schema| {
        let number = json!("number");
        let kind = schema.get("type");
        if kind.is_some_and(|kind| *kind == number || kind.get(0) == Some(&number)) {
            schema.insert("minimum".to_owned(), least.into());
            schema.insert("maximum".to_owned(), most.into());
        }
    });
    of_numbers.transform(schema);
}

/// Names no default, where it depends on other keys.
pub(crate) fn without_default(schema: &mut Schema) {
    schema.remove("default");
}

/// For `skip_serializing_if`: true for a value that files leave out.
pub(crate) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Positive numbers, as the checks of the physics take them.
pub(crate) fn positive(schema: &mut Schema) {
    bound(schema, [1e-100, 1e100]);
}

/// Numbers of 0 or more.
pub(crate) fn not_negative(schema: &mut Schema) {
    bound(schema, [0.0, 1e100]);
}

/// Exponents of contacts.
pub(crate) fn exponent(schema: &mut Schema) {
    bound(schema, [1.0, 1000.0]);
}
