//! Pages for people, self-contained: nothing is fetched from anywhere else.

use std::fmt::Write as _;

use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde_json::Value;

use super::AppState;
use super::openapi::{OPENAPI, document};

const STYLE: &str = include_str!("pages.css");

/// Lets a page load pictures of this server, and nothing else from anywhere.
const POLICY: &str =
    "default-src 'none'; img-src 'self'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";

/// `GET /openapi.json`
pub(super) async fn openapi() -> Response {
    ([(header::CONTENT_TYPE, "application/json")], OPENAPI).into_response()
}

/// `GET /`: the volumes, and a picture of every scene.
pub(super) async fn landing(State(state): State<AppState>) -> Response {
    let info = state.renderer.info();
    let mut body = format!(
        "<header><h1>spao-server</h1><p>{} on {}{}</p><nav><a href=\"/docs\">API</a> \
         <a href=\"/openapi.json\">OpenAPI</a> <a href=\"/v1/server\">Server</a></nav></header><main><h2>Scenes</h2>",
        env!("CARGO_PKG_VERSION"),
        escape(&info.adapter),
        if info.software { " (software)" } else { "" },
    );
    let scenes = state.scenes.list();
    if scenes.is_empty() {
        body.push_str("<p class=\"none\">None yet: <code>POST /v1/scenes</code> makes one.</p>");
    }
    body.push_str("<div class=\"scenes\">");
    for scene in scenes {
        let scene = scene.snapshot();
        let name = state.volumes.get(&scene.scene.volume.0).map_or("deleted volume".into(), |v| v.name.clone());
        let path = format!("/v1/scenes/{}", scene.id);
        push(
            &mut body,
            format_args!(
                "<a class=\"scene\" href=\"{path}/frame\"><img loading=\"lazy\" width=\"480\" height=\"360\" \
                 alt=\"scene {id}\" src=\"{path}/frame?width=480&amp;height=360\"><span>{name}</span>\
                 <code>{id}</code></a>",
                id = scene.id,
                name = escape(&name),
            ),
        );
    }
    body.push_str("</div><h2>Volumes</h2><table><tr><th>Name<th>Id<th>Voxels<th>Type<th>Values<th>GPU</tr>");
    for entry in state.volumes.list() {
        let [x, y, z] = entry.volume.grid.dims;
        let [low, high] = entry.volume.code_map.value_range();
        push(
            &mut body,
            format_args!(
                "<tr><td>{}<td><a href=\"/v1/volumes/{id}\"><code>{id}</code></a><td>{x} × {y} × {z}<td>{}\
                 <td>{low} … {high}<td>{:.1} MiB</tr>",
                escape(&entry.name),
                entry.volume.voxels.voxel_type(),
                entry.gpu_bytes as f64 / f64::from(1 << 20),
                id = entry.id,
            ),
        );
    }
    body.push_str("</table></main>");
    page("spao-server", &body)
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
