//! Secrets in texts that are printed: values that the environment or a request holds, in whatever form a store echoes them, and
//! places of URLs where secrets stand.

use std::borrow::Cow;
use std::env;
use std::ffi::OsString;

/// Stands where a secret stood.
const HIDDEN: &str = "[hidden]";

/// Shortest value that is taken for a secret: no store issues shorter ones, and words of messages stay.
const LEAST_BYTES: usize = 8;

/// Variables of the environment that may hold secrets begin so.
const STORES: [&str; 3] = ["AWS_", "GOOGLE_", "AZURE_"];

/// Words in the names of variables that hold secrets.
const SECRET: [&str; 6] = ["SECRET", "TOKEN", "PASSWORD", "KEY", "SAS", "SIGNATURE"];

/// Ends of the names of variables for places and identities.
const OPEN: [&str; 6] = ["_ID", "_FILE", "_PATH", "_URI", "_URL", "_ENDPOINT"];

/// Keys of queries whose values are secrets: signed URLs of S3, Google and Azure, and bearer tokens.
const QUERIES: [&str; 10] = [
    "x-amz-signature",
    "x-amz-credential",
    "x-amz-security-token",
    "x-goog-signature",
    "x-goog-credential",
    "signature",
    "awsaccesskeyid",
    "sig",
    "access_token",
    "token",
];

/// `text` without the secrets that the environment holds, passwords in URLs, and signatures in queries.
pub fn masked(text: &str) -> String {
    Secrets::of_environment().mask(text)
}

/// Values that no text may show.
#[derive(Debug, Default)]
pub(crate) struct Secrets {
    /// The longest first, so that none is cut by a part of itself.
    forms: Vec<String>,
}

impl Secrets {
    /// Those that the environment holds.
    pub(crate) fn of_environment() -> Self {
        let texts =
            |(name, value): (OsString, OsString)| Some((name.into_string().ok()?, value.into_string().ok()?));
        Self::of_variables(env::vars_os().filter_map(texts))
    }

    fn of_variables(variables: impl Iterator<Item = (String, String)>) -> Self {
        let mut secrets = Self::default();
        for (name, value) in variables {
            let name = name.to_ascii_uppercase();
            let is_of_store = STORES.iter().any(|prefix| name.starts_with(prefix));
            let is_secret = SECRET.iter().any(|word| name.contains(word));
            if is_of_store && is_secret && !OPEN.iter().any(|end| name.ends_with(end)) {
                secrets.add(&value);
            }
            if let Some((user, password)) = user_of(&value) {
                secrets.add(password);
                secrets.add(&format!("{user}:{password}"));
            }
        }
        secrets
    }

    /// Adds a value, and its forms in a header: `Bearer VALUE`, `…, Signature=VALUE`.
    pub(crate) fn add(&mut self, value: &str) {
        let ends = ["Signature=", "sig=", "Bearer ", "Basic "];
        let parts = ends.iter().filter_map(|end| Some(value.split_once(end)?.1));
        let parts = parts.filter_map(|part| part.split(['&', ',', ' ']).next());
        for secret in std::iter::once(value).chain(parts).map(str::trim) {
            if secret.len() < LEAST_BYTES {
                continue;
            }
            self.forms.push(secret.to_owned());
            for skipped in 0..3 {
                let form = base64(secret.as_bytes(), skipped);
                self.forms.push(form.replace('+', "-").replace('/', "_"));
                self.forms.push(form);
            }
        }
        self.forms.sort_by(|one, other| other.len().cmp(&one.len()).then_with(|| one.cmp(other)));
        self.forms.dedup();
    }

    /// `text` without them.
    pub(crate) fn mask(&self, text: &str) -> String {
        let mut shown = String::with_capacity(text.len());
        let mut rest = text;
        while let Some(first) = rest.chars().next() {
            if let Some(end) = self.forms.iter().find_map(|form| begins(rest, form)) {
                shown.push_str(HIDDEN);
                rest = &rest[end..];
            } else {
                shown.push(first);
                rest = &rest[first.len_utf8()..];
            }
        }
        without_signatures(&without_passwords(&shown))
    }
}

/// The length of `value` at the beginning of `text`, each character of it written in whatever way; values are ASCII or are written
/// as they are. None if something else stands there.
fn begins(text: &str, value: &str) -> Option<usize> {
    let Some(character) = value.chars().next() else { return Some(0) };
    let value = &value[character.len_utf8()..];
    // `&` may be itself or begin `&amp;`
    let literal = text.strip_prefix(character);
    let escaped = escaped(text).filter(|(found, _)| *found == character).map(|(_, rest)| rest);
    let goes_on = |rest: &str| Some(text.len() - rest.len() + begins(rest, value)?);
    literal.and_then(goes_on).or_else(|| escaped.and_then(goes_on))
}

/// The first character of `text`, if it is written as URLs (`%2F`, and once more `%252F`), JSON (`\/`, `\u002f`), XML or HTML
/// (`&#47;`, `&amp;`) write it, and what follows it.
fn escaped(text: &str) -> Option<(char, &str)> {
    let of_hex = |digits: &str| char::from_u32(u32::from_str_radix(digits, 16).ok()?);
    if let Some(rest) = text.strip_prefix('%') {
        let rest = rest.strip_prefix("25").filter(|rest| of_hex(rest.get(..2).unwrap_or("-")).is_some());
        let rest = rest.unwrap_or(&text[1..]);
        return Some((of_hex(rest.get(..2)?)?, &rest[2..]));
    }
    if let Some(rest) = text.strip_prefix("\\u") {
        return Some((of_hex(rest.get(..4)?)?, &rest[4..]));
    }
    if let Some(rest) = text.strip_prefix('\\') {
        let first = rest.chars().next()?;
        return Some((first, &rest[first.len_utf8()..]));
    }
    let entity = text.strip_prefix('&')?;
    let (name, rest) = entity.split_at_checked(entity.find(';').filter(|end| *end <= 8)?)?;
    Some((entity_of(name)?, &rest[1..]))
}

/// The character that `&name;` stands for.
pub(crate) fn entity_of(name: &str) -> Option<char> {
    let number = match name {
        "amp" => return Some('&'),
        "lt" => return Some('<'),
        "gt" => return Some('>'),
        "quot" => return Some('"'),
        "apos" => return Some('\''),
        _ => name.strip_prefix('#')?,
    };
    let code = match number.strip_prefix(['x', 'X']) {
        Some(hex) => u32::from_str_radix(hex, 16),
        None => number.parse(),
    };
    char::from_u32(code.ok()?)
}

/// Characters of base64 that follow from `bytes` alone where `skipped` bytes are before them in a group of three.
pub(crate) fn base64(bytes: &[u8], skipped: usize) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let bits = (skipped * 8)..(skipped + bytes.len()) * 8;
    let bit = |at: usize| (bytes[at / 8 - skipped] >> (7 - at % 8)) & 1;
    let digit = |first: usize| (first..first + 6).fold(0, |digit, at| digit << 1 | bit(at));
    let whole = bits.start.div_ceil(6)..bits.end / 6;
    whole.map(|place| char::from(DIGITS[usize::from(digit(place * 6))])).collect()
}

/// User and password of the URL `text`.
fn user_of(text: &str) -> Option<(&str, &str)> {
    let (_, rest) = text.split_once("://")?;
    let authority = rest.split(['/', '?', '#']).next()?;
    authority.rsplit_once('@')?.0.split_once(':')
}

/// `text` without `USER:PASSWORD@` after `://`.
fn without_passwords(text: &str) -> Cow<'_, str> {
    let mut shown = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once("://") {
        shown.push_str(before);
        shown.push_str("://");
        let ends = |c: char| c.is_whitespace() || matches!(c, '/' | '?' | '#' | '"' | '\'' | '<' | '>');
        let authority = &after[..after.find(ends).unwrap_or(after.len())];
        rest = after;
        if let Some((_, host)) = authority.rsplit_once('@') {
            shown.push_str(HIDDEN);
            shown.push('@');
            rest = &after[authority.len() - host.len()..];
        }
    }
    if shown.is_empty() {
        return text.into();
    }
    (shown + rest).into()
}

/// `text` without the values of [`QUERIES`].
fn without_signatures(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('=') {
        shown.push_str(before);
        shown.push('=');
        rest = after;
        let is_of_key = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_');
        let name = before.rsplit(|c| !is_of_key(c)).next().unwrap_or_default();
        let of_query = before[..before.len() - name.len()].ends_with(['?', '&', ';']);
        if of_query && QUERIES.iter().any(|query| name.eq_ignore_ascii_case(query)) {
            let ends = |c: char| c.is_whitespace() || matches!(c, '&' | '"' | '\'' | '<' | '>' | '#');
            shown.push_str(HIDDEN);
            rest = &after[after.find(ends).unwrap_or(after.len())..];
        }
    }
    shown + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOKEN: &str = "FwoGZXIvYXdzE/z+=a&b\"c";

    fn secrets() -> Secrets {
        let variables = [
            ("AWS_SESSION_TOKEN", TOKEN),
            ("AWS_SECRET_ACCESS_KEY", "wJalrXUtnFEMI/K7MDENG"),
            ("AWS_ACCESS_KEY_ID", "AKIAIOSFODNN7EXAMPLE"),
            ("AZURE_STORAGE_ACCOUNT_KEY", "short"),
            ("GOOGLE_APPLICATION_CREDENTIALS", "/home/me/key.json"),
            ("https_proxy", "http://me:topsecret1@proxy:3128"),
            ("HOME", "/home/somebody"),
        ];
        Secrets::of_variables(variables.map(|(name, value)| (name.to_owned(), value.to_owned())).into_iter())
    }

    #[test]
    fn a_secret_is_hidden_in_every_form_that_a_store_writes() {
        let forms = [
            TOKEN.to_owned(),
            "FwoGZXIvYXdzE%2Fz%2B%3Da%26b%22c".to_owned(),
            "FwoGZXIvYXdzE%2fz%2b%3da%26b%22c".to_owned(),
            "FwoGZXIvYXdzE%252Fz%252B%253Da%2526b%2522c".to_owned(),
            r#"FwoGZXIvYXdzE\/z+=a&b\"c"#.to_owned(),
            r#"FwoGZXIvYXdzE\/z\u002B\u003da\u0026b\"c"#.to_owned(),
            "FwoGZXIvYXdzE/z+=a&amp;b&quot;c".to_owned(),
            "FwoGZXIvYXdzE&#47;z&#x2B;=a&#38;b&#x22;c".to_owned(),
            "wJalrXUtnFEMI/K7MDENG".to_owned(),
            "topsecret1".to_owned(),
        ];
        for form in forms {
            assert_eq!(secrets().mask(&format!("before {form} after")), "before [hidden] after", "{form}");
        }
    }

    #[test]
    fn a_secret_is_hidden_in_base64_wherever_it_stands_there() {
        // as `base64` writes `wJalrXUtnFEMI/K7MDENG` behind nothing, `a` and `ab`
        for (text, at) in [
            ("d0phbHJYVXRuRkVNSS9LN01ERU5H", 0),
            ("YXdKYWxyWFV0bkZFTUkvSzdNREVORw==", 2),
            ("YWJ3SmFsclhVdG5GRU1JL0s3TURFTkc=", 3),
        ] {
            let shown = secrets().mask(text);
            assert!(shown.len() < 16 && shown[at..].starts_with(HIDDEN), "{shown}");
        }
    }

    #[test]
    fn words_names_and_places_are_shown() {
        for text in [
            "s3://bucket/key: not found: AKIAIOSFODNN7EXAMPLE, short, 100 % of a\\b &c; &unknown; é",
            "/home/me/key.json cannot be read",
            "http://host:80/a?b=c&partNumber=1",
        ] {
            assert_eq!(secrets().mask(text), text);
        }
    }

    #[test]
    fn passwords_and_signatures_in_urls_are_hidden_whoever_wrote_them() {
        for (text, shown) in [
            ("at https://you:pass@host/x?y", "at https://[hidden]@host/x?y"),
            ("(https://h/k?X-Amz-Signature=0a1b&part=1)", "(https://h/k?X-Amz-Signature=[hidden]&part=1)"),
            ("https://h/k?sv=1&sig=abc%3D: no", "https://h/k?sv=1&sig=[hidden] no"),
        ] {
            assert_eq!(Secrets::default().mask(text), shown);
        }
    }

    #[test]
    fn a_value_in_a_header_is_hidden_without_its_scheme() {
        let mut secrets = Secrets::default();
        secrets.add("Bearer abcdefgh12345678");
        secrets.add("AWS4-HMAC-SHA256 Credential=A/b, SignedHeaders=host, Signature=0123456789abcdef");
        assert_eq!(secrets.mask("it was abcdefgh12345678"), "it was [hidden]");
        assert_eq!(secrets.mask("<SignatureProvided>0123456789abcdef<"), "<SignatureProvided>[hidden]<");
    }
}
