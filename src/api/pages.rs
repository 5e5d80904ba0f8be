//! Pages for people, self-contained: nothing is fetched from anywhere else.

use std::fmt::Write as _;

use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde_json::Value;

use super::openapi::{OPENAPI, document};

const STYLE: &str = include_str!("pages.css");

/// Lets a page load pictures of this server, and nothing else from anywhere.
const POLICY: &str =
    "default-src 'none'; img-src 'self'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";

/// `GET /openapi.json`
pub(super) async fn openapi() -> Response {
    ([(header::CONTENT_TYPE, "application/json")], OPENAPI).into_response()
}

/// `GET /docs`: the OpenAPI document for reading.
pub(super) async fn docs() -> Response {
    let document = document();
    let text = |value: &Value| escape(value.as_str().unwrap_or_default());
    let mut body = format!(
        "<header><h1>{}</h1><p>{}</p><nav><a href=\"/\">Home</a> <a href=\"/openapi.json\">OpenAPI</a></nav></header><main>",
        text(&document["info"]["title"]),
        text(&document["info"]["description"]),
    );
    for (path, item) in document["paths"].as_object().into_iter().flatten() {
        for (method, operation) in item.as_object().into_iter().flatten().filter(|(key, _)| *key != "parameters") {
            push(
                &mut body,
                format_args!(
                    "<details><summary><b class=\"{method}\">{}</b> <code>{}</code> {}</summary><p>{}</p>",
                    method.to_uppercase(),
                    escape(path),
                    text(&operation["summary"]),
                    text(&operation["description"]),
                ),
            );
            let parameters = [&item["parameters"], &operation["parameters"]];
            for parameter in parameters.into_iter().filter_map(Value::as_array).flatten() {
                let parameter = resolve(&document, parameter);
                push(
                    &mut body,
                    format_args!(
                        "<p><code>{}</code> <small>{}</small> {}</p>",
                        text(&parameter["name"]),
                        text(&parameter["in"]),
                        text(&parameter["description"]),
                    ),
                );
            }
            for (status, response) in operation["responses"].as_object().into_iter().flatten() {
                let response = resolve(&document, response);
                push(&mut body, format_args!("<p><b>{status}</b> {}</p>", text(&response["description"])));
            }
            body.push_str("</details>");
        }
    }
    body.push_str("<h2>Schemas</h2>");
    for (name, schema) in document["components"]["schemas"].as_object().into_iter().flatten() {
        let schema = serde_json::to_string_pretty(schema).unwrap_or_default();
        push(
            &mut body,
            format_args!("<details><summary>{}</summary><pre>{}</pre></details>", escape(name), escape(&schema)),
        );
    }
    body.push_str("</main>");
    page("spao-server API", &body)
}

/// What a `$ref` within the document stands for; anything else is itself.
fn resolve<'a>(document: &'a Value, value: &'a Value) -> &'a Value {
    let target = value["$ref"].as_str().and_then(|reference| document.pointer(reference.strip_prefix('#')?));
    target.unwrap_or(value)
}

fn push(body: &mut String, text: std::fmt::Arguments<'_>) {
    // Writing into a String cannot fail.
    let _ = body.write_fmt(text);
}

fn page(title: &str, body: &str) -> Response {
    let html = format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <link rel=\"icon\" href=\"data:,\"><title>{title}</title><style>{STYLE}</style><body>{body}</body></html>"
    );
    let headers = [
        (header::CONTENT_TYPE, "text/html; charset=utf-8"),
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::CACHE_CONTROL, "no-store"),
    ];
    (headers, html).into_response()
}

/// Text that a client chose, made harmless.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            c => escaped.push(c),
        }
    }
    escaped
}
