use super::*;
use crate::integrators::METHODS;

/// A folder with a scene file and two pictures, none of which is read, and a study file with this text.
fn read(text: &str) -> Result<StudyPlan, PlanError> {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::create_dir(folder.path().join("box")).expect("made");
    for name in ["box/scene.xml", "box/r.mean.exr", "box/r.var.exr"] {
        std::fs::write(folder.path().join(name), "").expect("written");
    }
    let file = folder.path().join("s.toml");
    std::fs::write(&file, text).expect("written");
    StudyPlan::read(&file, METHODS)
}

const REST: &str = "[[scene]]\nfile = \"box/scene.xml\"\n[[method]]\nname = \"path\"\n";

#[test]
fn a_short_study_has_its_defaults() {
    let plan = read(&format!("seeds = 3\nbudget = {{ iterations = 4 }}\n{REST}")).expect("a study");
    assert_eq!((plan.name.as_str(), plan.seeds.as_slice(), plan.keep), ("s", &[1, 2, 3][..], Keep::Final));
    assert_eq!((plan.snapshots, plan.threads), (Snapshots::PowersOfTwo, None));
    assert_eq!((plan.scenes[0].name.as_str(), plan.scenes[0].changes.min_depth), ("box", 1));
    assert_eq!((plan.methods[0].label.as_str(), plan.methods[0].until), ("path", Until::Iterations(4)));
    assert_eq!((plan.reference.method.name, plan.reference.runs), ("path", 8));
}

#[test]
fn every_key_is_read() {
    let plan = read(
        "name = \"n\"\nseeds = [7, 3]\nbudget = { time = 2 }\nkeep = \"snapshots\"\nsnapshots = \"every:5\"\nthreads = 2\n\
         [reference]\nmethod = \"sppm\"\nradius = 0.25\nruns = 4\nbudget = { photons = 1_000 }\ncache = \"shared\"\n\
         [[scene]]\nname = \"a\"\nfile = \"box/scene.xml\"\nreference = \"box/r.mean.exr\"\nresolution = \"8x6\"\ncrop = [1, 2, 3, 4]\n\
         max_depth = -1\nmin_depth = 2\nhide_emitters = true\npaths = \"LD+E\"\ndefine = { light = 5, name = \"x\", on = true }\n\
         [[method]]\nname = \"sppm\"\nradius_pixels = 2\nalpha = 0.5\nbudget = { photons = 9 }\n\
         [report]\nguides = true\nslope = { from = 4, to = 64 }\ninsets = [{ scene = \"a\", x = 1, y = 2, width = 3, height = 4 }]\n",
    )
    .expect("a study");
    assert_eq!((plan.name.as_str(), plan.seeds.as_slice(), plan.keep, plan.threads), ("n", &[7, 3][..], Keep::Snapshots, Some(2)));
    assert_eq!(plan.reference.to_json()["settings"]["radius"], 0.25);
    assert!(plan.reference.cache.is_some_and(|folder| folder.ends_with("shared")));
    let scene = &plan.scenes[0];
    assert!(scene.reference_var.as_ref().is_some_and(|path| path.ends_with("box/r.var.exr")));
    let define: Vec<(&str, &str)> = scene.changes.define.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect();
    assert_eq!(define, [("light", "5"), ("name", "x"), ("on", "true")]);
    assert_eq!((scene.changes.crop.map(|c| c.0), scene.changes.max_depth), (Some([1, 2, 3, 4]), Some(-1)));
    assert_eq!((scene.changes.min_depth, scene.changes.hide_emitters), (2, true));
    assert_eq!(plan.methods[0].to_json()["settings"]["radius_pixels"], 2.0);
    assert_eq!(plan.methods[0].until, Until::Photons(9));
    assert_eq!(plan.report["slope"]["to"], 64);
}

#[test]
fn labels_say_what_differs() {
    let methods = "[[method]]\nname = \"path\"\n[[method]]\nname = \"sppm\"\nalpha = 0.5\n[[method]]\nname = \"sppm\"\nalpha = 0.5\nradius_pixels = 2\n";
    let plan = read(&format!("seeds = 1\nbudget = {{ time = 1 }}\n[[scene]]\nfile = \"box/scene.xml\"\n{methods}")).expect("a study");
    let labels: Vec<&str> = plan.methods.iter().map(|m| m.label.as_str()).collect();
    assert_eq!(labels, ["path", "sppm", "sppm, radius_pixels 2"]);
}

/// Texts with one mistake, the place where it is told, and words of the message with its help.
const MISTAKES: &[(&str, &str, &[&str])] = &[
    ("seeds = 1\nbudjet = 3\nREST", "2:1", &["unknown key \"budjet\" in the top", "did you mean \"budget\""]),
    ("seeds = [1\nREST", "", &[]),
    ("budget = { time = 1 }\nREST", "1:1", &["seeds are missing", "seeds = 8"]),
    ("seeds = 0\nBUDGET\nREST", "1:9", &["seeds must be a whole number from 1 to 1000000, not 0"]),
    ("seeds = [4, 5, 4]\nBUDGET\nREST", "1:16", &["seed 4 stands here twice"]),
    ("seeds = []\nBUDGET\nREST", "1:9", &["empty"]),
    ("seeds = 1\nbudget = { time = 1, iterations = 2 }\nREST", "2:10", &["exactly one of time, iterations and photons"]),
    ("seeds = 1\nbudget = { time = -1 }\nREST", "2:19", &["time must be a positive number of seconds"]),
    ("seeds = 1\nbudget = { time = inf }\nREST", "2:19", &["time must be a positive number of seconds"]),
    ("seeds = 1\nbudget = { iterations = 1.5 }\nREST", "2:25", &["iterations must be a whole number from 1, not 1.5"]),
    ("seeds = 1\nbudget = { photons = 100 }\nREST", "6:8", &["path traces no light paths", "budget of its own"]),
    ("seeds = 1\nREST", "4:1", &["path has no budget"]),
    ("seeds = 1\nBUDGET\nkeep = \"all\"\nREST", "3:8", &["unknown keep \"all\"", "final, snapshots"]),
    ("seeds = 1\nBUDGET\nsnapshots = \"every:0\"\nREST", "3:13", &["none, pow2 or every:N"]),
    ("seeds = 1\nBUDGET\n[[method]]\nname = \"path\"", "1:1", &["there is no [[scene]]"]),
    ("seeds = 1\nBUDGET\n[scene]\nfile = \"box/scene.xml\"", "3:1", &["write [[scene]]"]),
    ("seeds = 1\nBUDGET\n[[scene]]\nfile = \"none.xml\"\n", "4:8", &["there is no file", "none.xml"]),
    ("seeds = 1\nBUDGET\n[[scene]]\nfile = \"box/scene.xml\"\nreference = \"none.exr\"\n", "5:13", &["there is no file", "none.exr"]),
    ("seeds = 1\nBUDGET\nREST[[scene]]\nfile = \"box/scene.xml\"\n", "8:8", &["two scenes are called \"box\", the other in line 4"]),
    ("seeds = 1\nBUDGET\nREST[[method]]\nname = \"path\"\n", "8:8", &["two methods are called \"path\", the other in line 6", "label"]),
    ("seeds = 1\nBUDGET\nREST[[method]]\nname = \"spmm\"\n", "8:8", &["unknown method \"spmm\"", "did you mean \"sppm\""]),
    (
        "seeds = 1\nBUDGET\nREST[[method]]\nname = \"sppm\"\nradius_pixel = 1\n",
        "9:1",
        &["unknown key \"radius_pixel\"", "did you mean \"radius_pixels\""],
    ),
    ("seeds = 1\nBUDGET\nREST[[method]]\nname = \"sppm\"\nphotons = -4\nalpha = 0.5\n", "9:11", &["photons: ", "-4"]),
    ("seeds = 1\nBUDGET\nREST[[method]]\nname = \"sppm\"\nalpha = nan\n", "9:9", &["alpha must be a finite number, not nan"]),
    ("seeds = 1\nBUDGET\nREST[[method]]\nname = \"sppm\"\nsampler = \"none\"\n", "9:11", &["sampler: ", "none"]),
    ("seeds = 1\nBUDGET\nREST[reference]\nruns = 1\n", "8:8", &["runs must be a whole number from 2"]),
    (
        "seeds = 1\nBUDGET\nREST[report]\ninsets = [{ scene = \"bax\", x = 0, y = 0, width = 1, height = 1 }]\n",
        "8:21",
        &["there is no scene \"bax\"", "\"box\""],
    ),
    (
        "seeds = 1\nBUDGET\nREST[report]\ninsets = [{ x = 0, y = 0, width = 4, height = 1 }]\n",
        "8:35",
        &["width of an inset is 4", "fractions"],
    ),
    ("seeds = 1\nBUDGET\nREST[report]\nslope = { from = 4, to = 2 }\n", "8:26", &["to must be larger than from"]),
    ("seeds = 1\nBUDGET\n[[scene]]\nfile = \"box/scene.xml\"\nresolution = \"8\"\n", "5:14", &["resolution: expected WIDTHxHEIGHT"]),
    ("seeds = 1\nBUDGET\n[[scene]]\nfile = \"box/scene.xml\"\nmax_depth = 0\n", "5:13", &["max_depth must be -1 or"]),
    ("seeds = 1\nBUDGET\n[[scene]]\nfile = \"box/scene.xml\"\npaths = \"L(\"\n", "5:9", &["paths: "]),
];

#[test]
fn mistakes_are_told_with_their_place_and_what_to_do() {
    for (text, place, words) in MISTAKES {
        let text = text.replace("BUDGET", "budget = { iterations = 4 }").replace("REST", REST);
        let Err(error) = read(&text) else { unreachable!("accepted:\n{text}") };
        let told = format!("{error}\n{}", error.help.as_deref().unwrap_or(""));
        assert!(told.contains(&format!("s.toml:{place}")), "{told}\nexpected at {place} of\n{text}");
        for word in *words {
            assert!(told.contains(word), "{told}\nwithout {word:?}, of\n{text}");
        }
    }
}

/// No prefix of a study, and no study with one byte changed, does anything but pass or be refused with a place.
#[test]
fn broken_texts_are_refused_and_never_worse() {
    let whole = format!("seeds = [1, 2]\nbudget = {{ time = 1.5 }}\n{REST}alpha = 3\n[report]\nguides = true\n");
    for end in 0..whole.len() {
        if let Err(error) = read(&whole[..end]) {
            assert!(error.to_string().contains("s.toml"), "{error}");
        }
        let mut bytes = whole.clone().into_bytes();
        bytes[end] = b"[]{}=\"#\n7"[end % 9];
        let _ = read(&String::from_utf8_lossy(&bytes));
    }
}
