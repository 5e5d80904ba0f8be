//! What the operator allows to be fetched.

use reqwest::Url;

/// A URL below which everything may be fetched.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AllowedSource(Url);

/// The schemes that can be fetched.
const SCHEMES: [&str; 5] = ["https", "http", "s3", "gs", "az"];

impl AllowedSource {
    /// Reads an argument such as `https://data.example/volumes/` or `s3://bucket`.
    ///
    /// # Errors
    /// Says what was expected.
    pub fn parse(text: &str) -> Result<Self, String> {
        let expected = "expected a URL such as https://data.example/volumes/ or s3://bucket/folder/";
        let url = Url::parse(text).map_err(|_| expected.to_owned())?;
        if !is_plain(&url) || url.query().is_some() {
            return Err(expected.to_owned());
        }
        Ok(Self(url))
    }

    /// Whether a URL is the allowed one or below it. `/head` is not above `/head.nrrd`, but above `/head/1.nrrd`.
    pub fn allows(&self, url: &Url) -> bool {
        let same_place = self.0.scheme() == url.scheme()
            && self.0.host_str() == url.host_str()
            && self.0.port_or_known_default() == url.port_or_known_default();
        let below = url.path().strip_prefix(self.0.path());
        let below = below.is_some_and(|rest| rest.is_empty() || rest.starts_with('/') || self.0.path().ends_with('/'));
        // Of `a%2f..%2f..%2fb`, some servers make the path `b`; parsing has dealt with plain `..` and with `%2e%2e`.
        let path = url.path().to_ascii_lowercase();
        let hidden = path.contains("%2f") || path.contains("%5c") || path.contains('\\');
        is_plain(url) && same_place && (below || self.0.path().is_empty()) && !hidden
    }
}

/// With a known scheme and a host; without a name, a password or a fragment.
fn is_plain(url: &Url) -> bool {
    SCHEMES.contains(&url.scheme())
        && url.host_str().is_some_and(|host| !host.is_empty())
        && url.username().is_empty()
        && url.password().is_none()
        && url.fragment().is_none()
}
