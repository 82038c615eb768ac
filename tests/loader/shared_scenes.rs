//! Scenes that lie beside the project, where there are any: they load unchanged.

use isophote::scene::mitsuba::{LoadOptions, load};
use std::path::Path;
use std::time::Instant;

const SCENES: [&str; 6] = ["cbox-spheres", "cornell-box", "modern-hall", "ring-caustic", "veach-bidir", "veach-mis"];

#[test]
fn the_shared_scenes_load() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/scenes");
    if !folder.is_dir() {
        eprintln!("SKIPPED: there is no {}; the scenes in it were not loaded", folder.display());
        return;
    }
    for name in SCENES {
        let start = Instant::now();
        let loaded = load(&folder.join(name).join("scene.xml"), &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        eprintln!("{name}: {:?}, {} files, {} notes", start.elapsed(), loaded.files.len(), loaded.notes.len());
        assert_eq!(loaded.defaults.sample_count, 64);
        assert_eq!(loaded.defaults.integrator.as_deref(), Some("path"));
        // Each of them asks for a tent filter, and for nothing else that is not done.
        assert!(
            loaded.notes.iter().all(|n| n.message.contains("rfilter") || n.message.contains("not used") || n.message.contains("no area")),
            "{:?}",
            loaded.notes
        );
        for note in &loaded.notes {
            eprintln!("  {note}");
        }
    }
}
