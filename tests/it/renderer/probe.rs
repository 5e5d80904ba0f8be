//! Probe.
use super::support::*;
use serde_json::json;
use std::time::Instant;

#[test]
fn probe() {
    let tf_opaque = json!({"points": [{"value": 40, "color": "#cc4422", "opacity": 0.0}, {"value": 90, "color": "#f2e6d9", "opacity": 0.9}, {"value": 200, "color": "#2266ff", "opacity": 1.0}]});
    let tf_soft = json!({"points": [{"value": 20, "color": "#cc4422", "opacity": 0.0}, {"value": 120, "color": "#22e6d9", "opacity": 0.1}, {"value": 250, "color": "#2266ff", "opacity": 0.3}]});
    for (name, volume) in [("boxes", boxes()), ("gyroid", gyroid()), ("gyroid oblique", oblique(gyroid()))] {
        let t = Instant::now();
        let mut studio = Studio::new(volume);
        println!("open {:?}", t.elapsed());
        for (tf_name, tf) in [("opaque", &tf_opaque), ("soft", &tf_soft)] {
            for camera in [json!(null), json!({"projection": "orthographic"})] {
                for ao in [json!({"method": "off"}), json!({"levels": 4})] {
                    let doc = json!({"transfer_function": tf, "camera": camera, "ambient_occlusion": ao, "lighting": {"exposure": 1.0}, "viewport": {"width": 64, "height": 64}});
                    let scene = studio.scene(&doc);
                    let t = Instant::now();
                    let picture = studio.picture(&scene, [64, 64]);
                    let gpu = t.elapsed();
                    let a = studio.accessibility(&scene);
                    let t = Instant::now();
                    let twin = Twin::new(&studio.volume).pixels(&scene, &Light { accessibility: Some(&a), exposure: spao_server::reference::Exposure::NONE }, [64, 64], &all_pixels([64, 64]));
                    let cpu = t.elapsed();
                    let d = Difference::between(picture.pixels.iter().copied().map(unit), twin.clone());
                    println!("{name} {tf_name} {camera} {ao}: {d:.3?} gpu {gpu:?} twin {cpu:?}");
                    for (i, (g, t)) in picture.pixels.iter().zip(&twin).enumerate() {
                        let d = Difference::between([unit(*g)], [*t]);
                        if d.worst > 6.0 { println!("   pixel {} {}: {g:?} {:?}", i % 64, i / 64, t.map(|c| c * 255.0)); }
                    }
                }
            }
        }
    }
}
