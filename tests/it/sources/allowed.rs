//! What is below an allowed URL, and what only looks so.

use reqwest::Url;
use spao_server::sources::AllowedSource;

fn allows(allowed: &str, url: &str) -> bool {
    let allowed = AllowedSource::parse(allowed).unwrap_or_else(|error| panic!("{allowed}: {error}"));
    Url::parse(url).is_ok_and(|url| allowed.allows(&url))
}

#[test]
fn what_is_below_an_allowed_url_may_be_fetched() {
    for (allowed, url) in [
        ("https://a.example", "https://a.example/b/c.nrrd?token=1"),
        ("https://a.example/", "https://a.example:443/c.nrrd"),
        ("https://a.example/data/", "https://A.example/data/c.nrrd"),
        ("https://a.example/data", "https://a.example/data/c.nrrd"),
        ("https://a.example/data/", "https://a.example/x/../data/c.nrrd"),
        ("https://a.example/c.nrrd", "https://a.example/c.nrrd"),
        ("http://a.example:8000/", "http://a.example:8000/c"),
        ("s3://bucket", "s3://bucket/folder/key"),
        ("s3://bucket/folder/", "s3://bucket/folder/key"),
        ("gs://bucket/", "gs://bucket/key"),
        ("az://container", "az://container/key"),
    ] {
        assert!(allows(allowed, url), "{allowed} {url}");
    }
}

#[test]
fn what_only_looks_allowed_may_not() {
    for (allowed, url) in [
        ("https://a.example/", "http://a.example/c"),
        ("https://a.example/", "https://a.example:8443/c"),
        ("https://a.example/", "https://a.example.evil.example/c"),
        ("https://a.example/", "https://a.example@evil.example/c"),
        ("https://a.example/", "https://user:secret@a.example/c"),
        ("https://a.example/", "https://evil.example/https://a.example/"),
        ("https://a.example/data", "https://a.example/database/c"),
        ("https://a.example/data/", "https://a.example/data/../c"),
        ("https://a.example/data/", "https://a.example/data/%2e%2e/c"),
        ("https://a.example/data/", "https://a.example/data/..%2fc"),
        ("https://a.example/data/", "https://a.example/data/..%5Cc"),
        ("https://a.example/data/", r"https://a.example/data/..\c"),
        ("https://a.example/", "https://a.example/c#d"),
        ("s3://bucket", "s3://bucket2/key"),
        ("s3://bucket/folder", "s3://bucket/folder2/key"),
        ("s3://bucket/folder/", "s3://bucket/folder/../key"),
        ("s3://bucket/", "gs://bucket/key"),
        ("https://a.example/", "file:///etc/passwd"),
    ] {
        assert!(!allows(allowed, url), "{allowed} {url}");
    }
}

#[test]
fn an_argument_that_allows_nothing_sensible_is_refused() {
    for bad in ["", "*", "a.example", "https://", "file:///data", "ftp://a/", "https://u:p@a/", "https://a/?b", "s3:/b"]
    {
        assert!(AllowedSource::parse(bad).is_err(), "{bad}");
    }
}
