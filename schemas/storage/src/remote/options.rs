//! Clients as the environment asks for them, but that they follow no redirect with keys to another host.

use object_store::{ClientConfigKey, ClientOptions, Error, Result};
use reqwest::redirect::{Action, Attempt, Policy};
use reqwest::{Certificate, Client, NoProxy, Proxy, Url};
use std::time::Duration;

/// Redirects that are followed one after the other.
const MOST_REDIRECTS: usize = 5;

/// A client as `options` want it, which follows no redirect that takes headers elsewhere.
pub(super) fn client(options: &ClientOptions, is_public: bool) -> Result<Client> {
    use ClientConfigKey as Key;
    let text = |key| options.get_config_value(&key);
    let is_set = |key| text(key).is_some_and(|value| is_true(&value));
    let time = |key| text(key).map(|value| duration(&value)).transpose();
    let agent = concat!("beadline/", env!("CARGO_PKG_VERSION")).to_owned();
    let mut builder = Client::builder()
        .redirect(Policy::custom(move |attempt| redirect(attempt, is_public)))
        .user_agent(text(Key::UserAgent).unwrap_or(agent))
        .https_only(!is_set(Key::AllowHttp))
        .danger_accept_invalid_certs(is_set(Key::AllowInvalidCertificates));
    if let Some(headers) = options.get_default_headers() {
        builder = builder.default_headers(headers.clone());
    }
    if is_set(Key::NoSystemCertificates) {
        builder = builder.tls_certs_only(std::iter::empty());
    }
    if let Some(url) = text(Key::ProxyUrl) {
        let mut proxy = Proxy::all(url).map_err(of_options)?;
        if let Some(certificate) = text(Key::ProxyCaCertificate) {
            let certificate = Certificate::from_pem(certificate.as_bytes()).map_err(of_options)?;
            builder = builder.tls_certs_merge(std::iter::once(certificate));
        }
        if let Some(hosts) = text(Key::ProxyExcludes) {
            proxy = proxy.no_proxy(NoProxy::from_string(&hosts));
        }
        builder = builder.proxy(proxy);
    }
    if let Some(timeout) = time(Key::Timeout)? {
        builder = builder.timeout(timeout);
    }
    if let Some(timeout) = time(Key::ConnectTimeout)? {
        builder = builder.connect_timeout(timeout);
    }
    if let Some(timeout) = time(Key::ReadTimeout)? {
        builder = builder.read_timeout(timeout);
    }
    if let Some(timeout) = time(Key::PoolIdleTimeout)? {
        builder = builder.pool_idle_timeout(timeout);
    }
    if is_set(Key::Http2Only) {
        builder = builder.http2_prior_knowledge();
    } else if is_set(Key::Http1Only) {
        builder = builder.http1_only();
    }
    builder.build().map_err(of_options)
}

fn of_options(error: reqwest::Error) -> Error {
    Error::Generic { store: "HTTP client", source: Box::new(error) }
}

fn is_true(value: &str) -> bool {
    matches!(value.to_ascii_lowercase().as_str(), "1" | "true" | "on" | "yes" | "y")
}

/// A time as `object_store` writes and reads it: `30s`, `1m 30s`, `5 minutes`.
fn duration(text: &str) -> Result<Duration> {
    let wrong = || {
        let why = format!("expected a time such as `30s` or `5 minutes`, found `{text}`");
        Error::Generic { store: "HTTP client", source: why.into() }
    };
    let (mut time, mut rest) = (Duration::ZERO, text.trim());
    while !rest.is_empty() {
        let (number, after) = rest.split_at(rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len()));
        let after = after.trim_start();
        let (unit, after) =
            after.split_at(after.find(|c: char| !c.is_ascii_alphabetic()).unwrap_or(after.len()));
        let one = match unit {
            "ns" | "nsec" => Duration::from_nanos(1),
            "us" | "usec" => Duration::from_micros(1),
            "ms" | "msec" => Duration::from_millis(1),
            "s" | "sec" | "secs" | "second" | "seconds" => Duration::from_secs(1),
            "m" | "min" | "mins" | "minute" | "minutes" => Duration::from_mins(1),
            "h" | "hr" | "hrs" | "hour" | "hours" => Duration::from_hours(1),
            "d" | "day" | "days" => Duration::from_hours(24),
            _ => return Err(wrong()),
        };
        let count = number.parse().map_err(|_| wrong())?;
        time = one.checked_mul(count).and_then(|more| time.checked_add(more)).ok_or_else(wrong)?;
        rest = after.trim_start();
    }
    if text.trim().is_empty() { Err(wrong()) } else { Ok(time) }
}

/// Follows redirects that stay at the host, and without keys also others, but never from TLS to none.
fn redirect(attempt: Attempt<'_>, is_public: bool) -> Action {
    let place =
        |url: &Url| (url.scheme().to_owned(), url.host_str().map(str::to_owned), url.port_or_known_default());
    let (from, to) = (attempt.previous().first().map(place), place(attempt.url()));
    let is_weaker = to.0 != "https" && from.as_ref().is_some_and(|from| from.0 == "https");
    let may = is_public || from.as_ref() == Some(&to);
    if may && !is_weaker && attempt.previous().len() <= MOST_REDIRECTS {
        attempt.follow()
    } else {
        attempt.stop()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_as_object_store_writes_them() {
        for (text, seconds) in
            [("30s", 30), ("1m 30s", 90), ("5 minutes", 300), ("1h", 3600), ("60 seconds", 60)]
        {
            assert_eq!(duration(text).expect("a time"), Duration::from_secs(seconds));
        }
        for text in ["", "30", "s", "1 fortnight", "99999999999999999999d", "-1s"] {
            assert!(duration(text).is_err(), "{text}");
        }
    }
}
