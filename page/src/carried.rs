//! The page as one file, with what it carries.

use crate::bundle::{MODULES, script};
use base64::{Engine as _, prelude::BASE64_STANDARD};
use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::json;
use sha2::{Digest, Sha256};
use std::io::Write;
use std::sync::LazyLock;

const HTML: &str = include_str!("../page.html");
const STYLE: &str = include_str!("../page.css");

/// The bytes that are packed at once, in some milliseconds.
const PIECE_BYTES: usize = 1 << 18;

static CODE: LazyLock<String> =
    LazyLock::new(|| script(MODULES).expect("a test holds the modules to the rules"));

/// Contents of a page.
#[derive(Debug, Clone, Copy)]
pub enum Carried<'a> {
    /// Runs of the server that hands the page out.
    Server {
        /// The title.
        title: &'a str,
    },
    /// A recording that is dropped onto it.
    Empty,
    /// A recording inside.
    Embedded {
        /// The title.
        title: &'a str,
        /// An MCAP file whose chunks are not compressed: browsers decompress gzip only.
        recording: &'a Packed,
        /// Results about it, as JSON.
        results: &'a Packed,
    },
}

/// The text of the page, as HTML in one file.
pub fn page(carried: Carried<'_>) -> String {
    let (kind, title) = match carried {
        Carried::Server { title } => ("server", title),
        Carried::Empty => ("empty", "Beadline"),
        Carried::Embedded { title, .. } => ("embedded", title),
    };
    // in a script nothing but `<` can end it
    let about = json!({ "kind": kind, "title": title }).to_string().replace('<', "\\u003c");
    let mut data = format!("<script type=\"application/json\" id=\"carried\">{about}</script>");
    if let Carried::Embedded { recording, results, .. } = carried {
        for (id, packed) in [("recording", recording), ("results", results)] {
            data.push_str("\n<script type=\"text/plain\" id=\"");
            data.push_str(id);
            data.push_str("\">");
            data.push_str(&packed.0);
            data.push_str("</script>");
        }
    }
    let is_served = matches!(carried, Carried::Server { .. });
    let policy = format!("<meta http-equiv=\"Content-Security-Policy\" content=\"{}\">", policy(is_served));
    fill(&[("style", STYLE), ("code", &CODE), ("carried", &data), ("csp", &policy)])
}

/// Content security policy of the page: it runs its own script and style, and connects to nothing but its server.
pub(crate) fn policy(is_served: bool) -> String {
    let hash = |text: &str| BASE64_STANDARD.encode(Sha256::digest(text.as_bytes()));
    let (script, style) = (hash(&CODE), hash(STYLE));
    let connect = if is_served { "'self'" } else { "'none'" };
    format!(
        "default-src 'none'; script-src 'sha256-{script}'; style-src 'sha256-{style}'; worker-src blob:; \
         img-src data: blob:; connect-src {connect}; base-uri 'none'; form-action 'none'"
    )
}

/// The page with its placeholders filled in, each once: what is filled in is not looked at again.
fn fill(values: &[(&str, &str)]) -> String {
    let mut page = String::new();
    let mut left = HTML;
    while let Some((before, (name, after))) =
        left.split_once("{{").and_then(|(before, rest)| Some((before, rest.split_once("}}")?)))
    {
        page.push_str(before);
        let value = values.iter().find(|(known, _)| *known == name);
        page.push_str(value.map_or("", |(_, value)| value));
        left = after;
    }
    page.push_str(left);
    page
}

/// Bytes as a page carries them: a gzip file in base64.
#[derive(Debug, Clone, Default)]
pub struct Packed(String);

impl Packed {
    /// Packs `bytes` as small as they get. After each piece `go_on` is told how many are packed; nothing comes of it where it
    /// says no.
    pub fn new(bytes: &[u8], mut go_on: impl FnMut(usize) -> bool) -> Option<Self> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        let mut done = 0;
        for piece in bytes.chunks(PIECE_BYTES) {
            // a Vec takes everything
            let _ = encoder.write_all(piece);
            done += piece.len();
            if !go_on(done) {
                return None;
            }
        }
        Some(Self(BASE64_STANDARD.encode(encoder.finish().unwrap_or_default())))
    }

    /// The number of bytes a page grows by.
    pub fn page_bytes(&self) -> usize {
        self.0.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::read::GzDecoder;
    use std::io::Read;

    /// The page without data (bytes).
    const MOST_BYTES: usize = 381_000;

    #[test]
    fn the_page_is_small_and_its_modules_keep_to_the_rules() {
        let code = script(MODULES).expect("modules that the page knows");
        let page = page(Carried::Empty);
        assert!(page.contains(&code) && page.contains(STYLE) && page.contains("\"kind\":\"empty\""));
        assert!(page.len() <= MOST_BYTES, "the page has {} bytes", page.len());
        assert!(!page.contains("{{"), "a placeholder is left");
        // the hashes are those of the elements' contents, to the byte
        assert!(page.contains(&format!(">{code}</script>")) && page.contains(&format!(">{STYLE}</style>")));
    }

    #[test]
    fn what_is_carried_is_no_markup_and_comes_back() {
        let (title, bytes) = ("</script><script>alert(1)</script>{{code}}", [7_u8; 1000]);
        let [recording, results] =
            [&bytes[..], b"{}"].map(|bytes| Packed::new(bytes, |_| true).expect("packed"));
        let page = page(Carried::Embedded { title, recording: &recording, results: &results });
        assert!(!page.contains("<script>alert"));
        assert_eq!(page.matches(CODE.as_str()).count(), 1);
        let inside = page.split_once("id=\"recording\">").expect("one").1.split_once('<').expect("its end").0;
        let mut found = Vec::new();
        let packed = BASE64_STANDARD.decode(inside).expect("base64");
        GzDecoder::new(packed.as_slice()).read_to_end(&mut found).expect("gzip");
        assert_eq!(found, bytes);
    }
}
