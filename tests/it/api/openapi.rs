//! The OpenAPI document says what the server does: the same routes, and the same fields in real answers.

use std::collections::BTreeSet;

use axum::http::Method;
use serde_json::{Value, json};
use spao_server::api::{document, route_table};
use spao_server::error::ErrorCode;

use super::{Server, request};
use crate::volume::independent;

type Pairs = BTreeSet<(String, String)>;

fn documented(document: &Value) -> Pairs {
    let paths = document["paths"].as_object().expect("paths");
    let pairs = paths.iter().flat_map(|(path, item)| {
        let methods = item.as_object().expect("an object").keys().filter(|key| *key != "parameters");
        methods.map(move |method| (path.clone(), method.to_uppercase()))
    });
    pairs.collect()
}

fn routed() -> Pairs {
    let pairs = route_table()
        .into_iter()
        .flat_map(|(path, methods)| methods.into_iter().map(move |method| (path.clone(), method.to_owned())));
    pairs.collect()
}

/// Every `$ref` that leads nowhere.
fn dangling(document: &Value) -> Vec<String> {
    fn walk(root: &Value, value: &Value, found: &mut Vec<String>) {
        match value {
            Value::Object(fields) => {
                if let Some(Value::String(target)) = fields.get("$ref")
                    && target.strip_prefix('#').and_then(|pointer| root.pointer(pointer)).is_none()
                {
                    found.push(target.clone());
                }
                fields.values().for_each(|field| walk(root, field, found));
            }
            Value::Array(items) => items.iter().for_each(|item| walk(root, item, found)),
            _ => {}
        }
    }
    let mut found = Vec::new();
    walk(document, document, &mut found);
    found
}

/// Where an answer's fields are not those of its schema: every field documented, every required one there.
fn mismatches(document: &Value, schema: &Value, value: &Value, path: &str) -> Vec<String> {
    if let Some(target) = schema["$ref"].as_str() {
        let target = document.pointer(&target[1..]).expect("references resolve");
        return mismatches(document, target, value, path);
    }
    if let (Some(properties), Some(fields)) = (schema["properties"].as_object(), value.as_object()) {
        let required = schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str);
        let missing = required.filter(|name| !fields.contains_key(*name)).map(|name| format!("{path}.{name} missing"));
        let mut found: Vec<String> = missing.collect();
        for (name, field) in fields {
            let path = format!("{path}.{name}");
            match properties.get(name) {
                Some(schema) => found.extend(mismatches(document, schema, field, &path)),
                None => found.push(format!("{path} undocumented")),
            }
        }
        return found;
    }
    if let (true, Some(items)) = (schema["items"].is_object(), value.as_array()) {
        let each = items.iter().flat_map(|item| mismatches(document, &schema["items"], item, &format!("{path}[]")));
        return each.collect();
    }
    let kind = match value {
        Value::Null => "null",
        Value::Bool(_) => "boolean",
        Value::Number(n) if n.is_f64() => "number",
        Value::Number(_) => "integer",
        Value::String(_) => "string",
        Value::Array(_) => "array",
        Value::Object(_) => "object",
    };
    let allowed: Vec<&str> = match &schema["type"] {
        Value::String(name) => vec![name],
        Value::Array(names) => names.iter().filter_map(Value::as_str).collect(),
        _ => return Vec::new(),
    };
    let fits = allowed.contains(&kind) || (kind == "integer" && allowed.contains(&"number"));
    if fits { Vec::new() } else { vec![format!("{path} is {kind}, not {allowed:?}")] }
}

#[test]
fn every_route_is_documented_and_every_documented_route_is_there() {
    let document = document();
    assert_eq!(documented(&document), routed());
    let mut other = document;
    other["paths"]["/livez"]["post"] = json!({});
    assert_ne!(documented(&other), routed());
}

#[tokio::test]
async fn the_route_table_is_what_the_router_does() {
    let server = Server::new(&[]);
    for (path, methods) in route_table() {
        let path = path.replace("{id}", "x").replace("{path}", "app.js");
        for method in ["GET", "POST", "PUT", "PATCH", "DELETE"] {
            let verb = Method::from_bytes(method.as_bytes()).expect("a method");
            let answer = server.send(request(verb, &path, &[], axum::body::Body::empty())).await;
            assert_eq!(answer.status != 405, methods.contains(&method), "{method} {path}: {answer:?}");
            assert!(answer.status != 404 || answer.code() != "not_found", "{method} {path}");
        }
    }
}

#[test]
fn every_reference_resolves() {
    let mut document = document();
    assert_eq!(dangling(&document), Vec::<String>::new());
    document["paths"]["/livez"]["get"]["responses"]["200"] = json!({ "$ref": "#/components/responses/None" });
    assert_eq!(dangling(&document), ["#/components/responses/None"]);
}

#[test]
fn every_error_code_is_documented() {
    let document = document();
    let codes = document["components"]["schemas"]["Error"]["properties"]["error"]["properties"]["code"]["enum"].clone();
    assert_eq!(codes, json!(ErrorCode::ALL.map(|code| code.name_and_status().0)));
}

#[tokio::test]
async fn real_answers_have_exactly_the_documented_fields() {
    let document = document();
    let check =
        |name: &str, value: &Value| mismatches(&document, &document["components"]["schemas"][name], value, name);
    let none = Vec::<String>::new();
    let server = Server::new(&[]);
    let scene = server.get(&server.scene().await).await.json();
    let volumes = server.get("/v1/volumes").await.json();
    let volume = volumes["volumes"][0]["id"].as_str().expect("an id").to_owned();
    assert_eq!(check("VolumeList", &volumes), none);
    assert_eq!(check("Scene", &scene), none);
    assert_eq!(check("SceneList", &server.get("/v1/scenes").await.json()), none);
    assert_eq!(check("Histogram", &server.get(&format!("/v1/volumes/{volume}/histogram?bins=4")).await.json()), none);
    assert_eq!(check("Probe", &server.get(&format!("/v1/volumes/{volume}/probe?x=1&y=1&z=1")).await.json()), none);
    let with_files = Server::new(&["--data-dir", independent::directory().to_str().expect("UTF-8")]);
    for query in ["", "?headers=true&limit=100"] {
        assert_eq!(check("FileList", &with_files.get(&format!("/v1/files{query}")).await.json()), none);
    }
    assert_eq!(check("Metadata", &server.get(&format!("/v1/volumes/{volume}/metadata")).await.json()), none);
    assert_eq!(check("PresetList", &server.get("/v1/presets").await.json()), none);
    assert_eq!(check("PresetList", &server.get(&format!("/v1/presets?volume={volume}")).await.json()), none);
    assert_eq!(check("Server", &server.get("/v1/server").await.json()), none);
    assert_eq!(check("Status", &server.get("/livez").await.json()), none);
    let source = json!({ "source": { "procedural": { "kind": "boxes", "dims": [4, 4, 4] } } });
    assert_eq!(check("VolumePlan", &server.post("/v1/volumes?dry_run=true", &source).await.json()), none);
    assert_eq!(check("Error", &server.get("/v1/volumes/none").await.json()), none);

    let mut extra = scene.clone();
    extra["camera"]["roll"] = json!(1);
    assert_eq!(check("Scene", &extra), ["Scene.camera.roll undocumented"]);
    let mut missing = volumes["volumes"][0].clone();
    missing.as_object_mut().expect("an object").remove("sha256");
    assert_eq!(check("Volume", &missing), ["Volume.sha256 missing"]);
    let mut wrong = scene;
    wrong["revision"] = json!("1");
    assert_eq!(check("Scene", &wrong), ["Scene.revision is string, not [\"integer\"]"]);
}

#[tokio::test]
async fn every_scene_field_of_the_document_is_in_a_complete_scene() {
    let document = document();
    let server = Server::new(&[]);
    let scene = server.get(&server.scene().await).await.json();
    let names = |value: &Value| value.as_object().expect("an object").keys().cloned().collect::<BTreeSet<_>>();
    for (section, schema) in [
        ("transfer_function", "TransferFunction"),
        ("camera", "Camera"),
        ("ambient_occlusion", "AmbientOcclusion"),
        ("lighting", "Lighting"),
        ("rendering", "Rendering"),
        ("viewport", "Viewport"),
    ] {
        let mut documented = names(&document["components"]["schemas"][schema]["properties"]);
        // Only ever read: a scene writes the points that the preset stood for.
        documented.remove("preset");
        assert_eq!(documented, names(&scene[section]), "{section}");
    }
}

#[tokio::test]
async fn the_document_is_served_as_it_is() {
    let server = Server::new(&[]);
    let answer = server.get("/openapi.json").await;
    assert_eq!((answer.header("content-type"), answer.json()), ("application/json", document()));
    let page = String::from_utf8(server.get("/docs").await.bytes).expect("UTF-8");
    for (path, _) in route_table() {
        assert!(page.contains(&format!("<code>{path}</code>")), "{path}");
    }
}
