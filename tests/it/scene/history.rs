//! Revisions, undo and redo.

use spao_server::scene::{HistoryError, Scene, SceneHistory};

use super::default_scene;

fn with_rays(rays: u32) -> Scene {
    let mut scene = default_scene();
    scene.ambient_occlusion.rays = rays;
    scene
}

#[test]
fn a_history_starts_at_revision_one_with_nothing_to_undo_or_redo() {
    let mut history = SceneHistory::new(with_rays(1));
    assert_eq!(history.revision(), 1);
    assert_eq!(history.undo(), Err(HistoryError::NothingToUndo));
    assert_eq!(history.redo(), Err(HistoryError::NothingToRedo));
    assert_eq!((history.revision(), &**history.scene()), (1, &with_rays(1)));
}

#[test]
fn undo_and_redo_walk_the_changes_under_new_revisions() {
    let mut history = SceneHistory::new(with_rays(1));
    assert_eq!(history.replace(with_rays(2)), 2);
    assert_eq!(history.replace(with_rays(3)), 3);
    assert_eq!((history.undo(), &**history.scene()), (Ok(4), &with_rays(2)));
    assert_eq!((history.undo(), &**history.scene()), (Ok(5), &with_rays(1)));
    assert_eq!(history.undo(), Err(HistoryError::NothingToUndo));
    assert_eq!((history.redo(), &**history.scene()), (Ok(6), &with_rays(2)));
    assert_eq!((history.redo(), &**history.scene()), (Ok(7), &with_rays(3)));
    assert_eq!(history.redo(), Err(HistoryError::NothingToRedo));
}

#[test]
fn a_change_forgets_what_could_be_redone() {
    let mut history = SceneHistory::new(with_rays(1));
    history.replace(with_rays(2));
    history.undo().expect("one change");
    history.replace(with_rays(3));
    assert_eq!(history.redo(), Err(HistoryError::NothingToRedo));
    history.undo().expect("one change");
    assert_eq!(**history.scene(), with_rays(1));
}

#[test]
fn replacing_by_an_equal_scene_changes_nothing() {
    let mut history = SceneHistory::new(with_rays(1));
    history.replace(with_rays(2));
    history.undo().expect("one change");
    assert_eq!(history.replace(with_rays(1)), 3);
    assert_eq!(history.undo(), Err(HistoryError::NothingToUndo));
    assert_eq!(history.redo(), Ok(4), "what could be redone still can");
}

#[test]
fn a_history_remembers_a_hundred_steps() {
    let mut history = SceneHistory::new(with_rays(1));
    for rays in 2..=300 {
        history.replace(with_rays(rays));
    }
    let steps = std::iter::from_fn(|| history.undo().ok()).count();
    assert_eq!(steps, 100);
    assert_eq!(**history.scene(), with_rays(200));
}
