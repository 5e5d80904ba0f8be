//! `bench edit`: what an edit of the transfer function costs beside a build from nothing.
//!
//! Times on a shared machine mean little, so every row is a ratio: each edit is measured next to a full build, round
//! by round, and the median of the ratios is reported.

use std::cell::RefCell;
use std::io::Write;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::plain::PlainForm;
use crate::ao::{Accessibility, AoBuild, AoWork, Pyramid};
use crate::config::BenchEditArgs;
use crate::renderer::{AoPolicy, Coverage, FrameRequest, Renderer};
use crate::scene::{ControlPoint, Scene, SceneDocument};
use crate::session::{LoadRequest, NewVolume, volume_facts};
use crate::volume::{Limits, VolumeId};

/// Size of the pictures whose times are compared.
const PICTURE: [u32; 2] = [640, 480];

/// Width of a narrow window, in Hounsfield units.
const WINDOW_WIDTH: f64 = 120.0;

/// What windows are moved through: bone, which is all over a head, and the metal of a few teeth.
const BONE: f64 = 1500.0;
const METAL: f64 = 2400.0;

/// A kind of edit: its name, what it may cost beside a full build, and the scene's points in every round.
struct Edit {
    name: &'static str,
    target: Option<f64>,
    points: fn(&[Value], u32) -> Vec<Value>,
}

const EDITS: [Edit; 6] = [
    Edit { name: "colours only", target: Some(0.0), points: recoloured },
    Edit { name: "unused range", target: Some(0.01), points: above_all_values },
    Edit { name: "narrow window, metal", target: Some(0.15), points: |p, round| narrow_window(p, METAL, round) },
    Edit { name: "narrow window, bone", target: Some(0.15), points: |p, round| narrow_window(p, BONE, round) },
    Edit { name: "dragged bone point", target: Some(0.35), points: dragged },
    Edit { name: "global opacity scale", target: None, points: scaled },
];

/// Prints the table.
pub(super) fn run(args: &BenchEditArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let mut renderer = Renderer::new(&args.gpu.options())?;
    let volume = LoadRequest::from_argument(&args.volume)?.prepare(&Limits::default(), None)?;
    let id = VolumeId("bench".into());
    renderer.add_volume(id.clone(), volume.volume.clone())?;
    let [x, y, z] = volume.volume.grid.dims;
    let preset = crate::scene::preset(&args.preset);
    let preset = preset.ok_or_else(|| anyhow::anyhow!("there is no preset `{}`", args.preset))?;
    let function = preset.transfer_function(volume.volume.code_map.value_range());
    let point = |p: &ControlPoint| json!({"value": p.value, "color": p.color.to_hex(), "opacity": p.opacity});
    let points: Vec<Value> = function.points.iter().map(point).collect();
    let function = json!({"points": points, "opacity_unit_distance": function.opacity_unit_distance});
    let document = json!({"volume": id.0, "transfer_function": function});
    let first = complete(&document, &id, &volume)?;
    writeln!(out, "adapter: {} ({})", renderer.info().adapter, renderer.info().driver_info)?;
    writeln!(out, "{}, {x} x {y} x {z}, {}, median of {} rounds", args.volume, args.preset, args.rounds)?;
    let scene = |points: Vec<Value>| {
        let mut document = document.clone();
        document["transfer_function"]["points"] = Value::Array(points);
        complete(&document, &id, &volume)
    };
    full_builds(&renderer, &first, args.rounds, out)?;
    writeln!(
        out,
        "\n{:22} {:>10} {:>10} {:>10} {:>9} {:>9} {:>8}",
        "edit", "classified", "tiles", "recomputed", "ms", "of full", "target"
    )?;
    for edit in &EDITS {
        let scenes = (0..=args.rounds).map(|round| scene((edit.points)(&points, round)));
        edit_row(&renderer, edit, &scenes.collect::<Result<Vec<_>, _>>()?, out)?;
    }
    pictures(&mut renderer, &scene, &points, args.rounds, out)
}

fn complete(document: &Value, id: &VolumeId, volume: &NewVolume) -> anyhow::Result<Arc<Scene>> {
    let facts = volume_facts(id, &volume.volume, &volume.histogram);
    Ok(Arc::new(SceneDocument::from_json(document)?.complete(&facts)?))
}

/// Runs a build to its end.
fn finish(renderer: &Renderer, mut build: AoBuild) -> anyhow::Result<(Rc<Accessibility>, AoWork)> {
    let (gpu, stages) = renderer.ao_tools();
    while !build.advance(gpu, stages)? {}
    build.finish(gpu, 1)?.ok_or_else(|| anyhow::anyhow!("the build did not finish"))
}

/// Time of a build of everything, in memory that has been used before.
fn full(
    renderer: &Renderer,
    scene: &Scene,
    coverage: Coverage,
    pyramid: &Rc<RefCell<Pyramid>>,
) -> anyhow::Result<Duration> {
    pyramid.borrow_mut().forget();
    let begin = Instant::now();
    finish(renderer, renderer.ao_update(scene, coverage, pyramid.clone())?)?;
    Ok(begin.elapsed())
}

/// The plain form, and the builds of this program.
fn full_builds(renderer: &Renderer, scene: &Scene, rounds: u32, out: &mut dyn Write) -> anyhow::Result<()> {
    let (gpu, _) = renderer.ao_tools();
    let dims = renderer.ao_source(scene)?.values.dims();
    if !renderer.info().texture_16bit_norm {
        return Ok(writeln!(out, "no 16-bit normalised textures: no comparison with the plain form")?);
    }
    let plain = PlainForm::new(gpu, dims, scene.ambient_occlusion.levels)?;
    let pyramid = renderer.new_pyramid(scene)?;
    let mut rows = [("plain form", Vec::new()), ("everywhere", Vec::new()), ("where visible", Vec::new())];
    for round in 0..=rounds {
        let source = renderer.ao_source(scene)?;
        let mut times = vec![plain.run(gpu, &source, &scene.ambient_occlusion)?];
        for coverage in [Coverage::Everywhere, Coverage::Visible] {
            times.push(full(renderer, scene, coverage, &pyramid)?);
        }
        // The first round compiles.
        if round > 0 {
            rows.iter_mut().zip(times).for_each(|(row, time)| row.1.push(time));
        }
    }
    writeln!(out, "\n{:22} {:>10} {:>16}", "full build", "ms", "plain / this")?;
    for (name, times) in &rows {
        let ratios = rows[0].1.iter().zip(times).map(|(plain, time)| plain.as_secs_f64() / time.as_secs_f64());
        writeln!(out, "{name:22} {:10.1} {:16.2}", median_ms(times), median(ratios.collect()))?;
    }
    Ok(())
}

fn edit_row(renderer: &Renderer, edit: &Edit, scenes: &[Arc<Scene>], out: &mut dyn Write) -> anyhow::Result<()> {
    let (pyramid, other) = (renderer.new_pyramid(&scenes[0])?, renderer.new_pyramid(&scenes[0])?);
    full(renderer, &scenes[0], Coverage::Visible, &other)?;
    // Held, so that the next update may start from it.
    let mut last = finish(renderer, renderer.ao_update(&scenes[0], Coverage::Visible, pyramid.clone())?)?;
    let (mut times, mut ratios, mut works) = (Vec::new(), Vec::new(), Vec::new());
    for pair in scenes.windows(2) {
        let begin = Instant::now();
        // A scene whose key is the same finds its result in the cache.
        let mut work = AoWork::default();
        if renderer.ao_key(&pair[0])? != renderer.ao_key(&pair[1])? {
            last = finish(renderer, renderer.ao_update(&pair[1], Coverage::Visible, pyramid.clone())?)?;
            work = last.1;
        }
        let elapsed = begin.elapsed();
        debug_assert_eq!(Rc::strong_count(&last.0), 1, "nobody else holds the result");
        ratios.push(elapsed.as_secs_f64() / full(renderer, &pair[1], Coverage::Visible, &other)?.as_secs_f64());
        times.push(elapsed);
        works.push(work);
    }
    let mean = |count: fn(&AoWork) -> u64| works.iter().map(count).sum::<u64>() / works.len().max(1) as u64;
    writeln!(
        out,
        "{:22} {:10} {:10} {:10} {:9.2} {:8.2}% {:>8}",
        edit.name,
        mean(|w| w.classified),
        mean(|w| w.tiles),
        mean(|w| w.recomputed),
        median_ms(&times),
        100.0 * median(ratios),
        edit.target.map_or("-".into(), |target| format!("{:.0}%", 100.0 * target)),
    )?;
    Ok(())
}

/// The first picture after an edit beside one after a move of the camera.
fn pictures(
    renderer: &mut Renderer,
    scene: &dyn Fn(Vec<Value>) -> anyhow::Result<Arc<Scene>>,
    points: &[Value],
    rounds: u32,
    out: &mut dyn Write,
) -> anyhow::Result<()> {
    let [width, height] = PICTURE;
    let mut draw = |scene: &Arc<Scene>, ao_policy| -> anyhow::Result<Duration> {
        let begin = Instant::now();
        renderer.render(&FrameRequest { scene: scene.clone(), width, height, ao_policy })?;
        Ok(begin.elapsed())
    };
    let (mut edits, mut cameras, mut exact) = (Vec::new(), Vec::new(), Vec::new());
    draw(&scene(dragged(points, 0))?, AoPolicy::Exact)?;
    for round in 1..=rounds {
        let edited = scene(dragged(points, round))?;
        edits.push(draw(&edited, AoPolicy::AtHand)?);
        cameras.push(draw(&edited, AoPolicy::AtHand)?);
        exact.push(draw(&edited, AoPolicy::Exact)?);
    }
    let ratios = edits.iter().zip(&cameras).map(|(edit, camera)| edit.as_secs_f64() / camera.as_secs_f64());
    writeln!(out, "\n{width} x {height} pictures, dragged bone point: ms")?;
    writeln!(out, "{:22} {:10.1}", "after a camera move", median_ms(&cameras))?;
    writeln!(out, "{:22} {:10.1} {:16.2}", "first after an edit", median_ms(&edits), median(ratios.collect()))?;
    writeln!(out, "{:22} {:10.1}", "exact after an edit", median_ms(&exact))?;
    Ok(())
}

fn recoloured(points: &[Value], round: u32) -> Vec<Value> {
    let mut points = points.to_vec();
    points[0]["color"] = format!("#{:06x}", (round * 4099) & 0xff_ffff).into();
    points
}

/// A point far above the highest value, and above all others.
fn above_all_values(points: &[Value], round: u32) -> Vec<Value> {
    let mut points = points.to_vec();
    let last = points.last().cloned().unwrap_or_default();
    points.push(json!({"value": 20_000.0, "color": last["color"], "opacity": last["opacity"]}));
    points.push(json!({"value": 30_000.0, "color": last["color"], "opacity": 0.1 + 0.01 * f64::from(round)}));
    points
}

/// Another opacity within the window alone: around it everything stays as it was.
fn narrow_window(points: &[Value], middle: f64, round: u32) -> Vec<Value> {
    let middle = middle + 10.0 * f64::from(round);
    let number = |point: &Value, field: &str| point[field].as_f64().unwrap_or(0.0);
    let line: Vec<[f64; 2]> = points.iter().map(|p| [number(p, "value"), number(p, "opacity")]).collect();
    let before = |value: f64| {
        let above = line.partition_point(|p| p[0] <= value);
        let [low, high] = [above.saturating_sub(1), above.min(line.len() - 1)].map(|at| line[at]);
        let share = if high[0] > low[0] { (value - low[0]) / (high[0] - low[0]) } else { 0.0 };
        low[1] + share * (high[1] - low[1])
    };
    let [low, high] = [middle - 0.5 * WINDOW_WIDTH, middle + 0.5 * WINDOW_WIDTH];
    let outside = |point: &&Value| !(low..=high).contains(&number(point, "value"));
    let mut points: Vec<Value> = points.iter().filter(outside).cloned().collect();
    let color = json!("#ff8800");
    let inside = [(low, before(low)), (low + 0.25 * WINDOW_WIDTH, 0.3), (high - 0.25 * WINDOW_WIDTH, 0.3)];
    for (value, opacity) in inside.into_iter().chain([(high, before(high))]) {
        points.push(json!({"value": value, "color": color, "opacity": opacity}));
    }
    points.sort_by(|a, b| number(a, "value").total_cmp(&number(b, "value")));
    points
}

/// The last point but two: bone, in the presets for CT.
fn dragged(points: &[Value], round: u32) -> Vec<Value> {
    let mut points = points.to_vec();
    let at = points.len().saturating_sub(3);
    let opacity = points[at]["opacity"].as_f64().unwrap_or(0.5);
    points[at]["opacity"] = (opacity - 0.02 * f64::from(round % 10)).clamp(0.0, 1.0).into();
    points
}

fn scaled(points: &[Value], round: u32) -> Vec<Value> {
    let mut points = points.to_vec();
    for point in &mut points {
        point["opacity"] = (point["opacity"].as_f64().unwrap_or(0.0) * (1.0 - 0.03 * f64::from(round % 10))).into();
    }
    points
}

fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(f64::NAN)
}

fn median_ms(times: &[Duration]) -> f64 {
    median(times.iter().map(|t| t.as_secs_f64() * 1e3).collect())
}
