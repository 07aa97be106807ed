//! Elements of the XML that stores answer with: enough of it for names, codes and sizes.

use crate::secrets::entity_of;
use std::ops::Range;

/// An element: where it stands, and where its content does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) all: Range<usize>,
    pub(super) content: Range<usize>,
}

/// The elements `name` of `text`, whatever their namespace; none of them is within another.
pub(super) fn elements<'a>(text: &'a str, name: &'a str) -> impl Iterator<Item = Element> + 'a {
    let mut from = 0;
    std::iter::from_fn(move || {
        let found = element(text, name, from)?;
        from = found.all.end;
        Some(found)
    })
}

/// The content of the first element `name` of `text`, its entities resolved.
pub(super) fn text_of(text: &str, name: &str) -> Option<String> {
    Some(resolved(&text[element(text, name, 0)?.content]))
}

/// The next element `name` from the byte `from` on.
fn element(text: &str, name: &str, mut from: usize) -> Option<Element> {
    loop {
        let start = from + text[from..].find('<')?;
        let end = start + text[start..].find('>')?;
        from = end + 1;
        let tag = &text[start + 1..end];
        let qualified = tag.split(|c: char| c.is_whitespace() || c == '/').next().unwrap_or_default();
        if qualified.rsplit(':').next() != Some(name) {
            continue;
        }
        if tag.ends_with('/') {
            return Some(Element { all: start..from, content: from..from });
        }
        let close = format!("</{qualified}>");
        let length = text[from..].find(&close)?;
        return Some(Element { all: start..from + length + close.len(), content: from..from + length });
    }
}

fn resolved(text: &str) -> String {
    let mut resolved = String::with_capacity(text.len());
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('&') {
        resolved.push_str(before);
        rest = after;
        let character = after.split_once(';').and_then(|(name, after)| Some((entity_of(name)?, after)));
        if let Some((character, after)) = character {
            resolved.push(character);
            rest = after;
        } else {
            resolved.push('&');
        }
    }
    resolved + rest
}

/// `text` as the content of an element.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_are_found_whatever_their_namespace() {
        let text =
            r#"<?xml version="1.0"?><L xmlns="x"><a>1 &amp; &#50;</a><D:a n="m">3</D:a><a/><ab>4</ab></L>"#;
        let found: Vec<_> = elements(text, "a").map(|found| &text[found.content]).collect();
        assert_eq!(found, ["1 &amp; &#50;", "3", ""]);
        assert_eq!(text_of(text, "a").as_deref(), Some("1 & 2"));
        assert_eq!(text_of(text, "ab").as_deref(), Some("4"));
        for torn in ["<a", "<a>", "<a>1", "<a>1</", "", "&", "<a>1</b>"] {
            assert_eq!(text_of(torn, "a"), None);
        }
        assert_eq!(resolved(&escaped("a<b>&c;")), "a<b>&c;");
    }
}
