//! Rays per second, alone or against Embree: see `run.sh` beside this file and `docs/rays.md`.

#[path = "../../rays/shapes.rs"]
mod shapes;
mod workload;

use cpu_time::ThreadTime;
use isophote::scene::accel::{Accel, Bvh, Primitive};
use std::env;
use std::error::Error;
use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use workload::{Set, Workload};

type Outcome<T> = Result<T, Box<dyn Error>>;

/// Rays asked together in the second of our two runs.
const AT_ONCE: usize = 256;

/// What one run over one set of rays gave.
#[derive(Clone, Copy, Default)]
struct Round {
    seconds: f64,
    hits: u64,
}

/// Embree in a process of its own, asked one set at a time.
struct Embree {
    child: Child,
    ask: ChildStdin,
    answer: BufReader<ChildStdout>,
}

impl Embree {
    /// None without `RAYS_EMBREE`, the program `run.sh` makes.
    fn start(work: &Workload) -> Outcome<Option<Self>> {
        let Some(program) = env::var_os("RAYS_EMBREE") else {
            return Ok(None);
        };
        let file = tempfile::NamedTempFile::new()?;
        work.write(&mut BufWriter::new(File::create(file.path())?))?;
        let mut child = Command::new(program).arg(file.path()).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let ask = child.stdin.take().ok_or("no pipe")?;
        let mut answer = BufReader::new(child.stdout.take().ok_or("no pipe")?);
        let mut ready = String::new();
        answer.read_line(&mut ready)?;
        Ok(Some(Self { child, ask, answer }))
    }

    fn run(&mut self, set: usize) -> Outcome<Round> {
        writeln!(self.ask, "{set}")?;
        let mut line = String::new();
        self.answer.read_line(&mut line)?;
        let mut words = line.split_whitespace();
        Ok(Round {
            seconds: words.next().ok_or("Embree's side ended")?.parse()?,
            hits: words.next().ok_or("Embree's side ended")?.parse()?,
        })
    }

    fn stop(mut self) -> Outcome<()> {
        drop(self.ask);
        self.child.wait()?;
        Ok(())
    }
}

fn ours(bvh: &Bvh, set: &Set) -> Round {
    let start = ThreadTime::now();
    let mut hits = 0;
    let mut sum = 0.0f64;
    if set.any {
        for ray in &set.rays {
            hits += u64::from(bvh.occluded(ray));
        }
    } else {
        for ray in &set.rays {
            if let Some(hit) = bvh.closest(ray) {
                hits += 1;
                sum += f64::from(hit.t);
            }
        }
    }
    std::hint::black_box(sum);
    Round { seconds: start.elapsed().as_secs_f64(), hits }
}

/// The same rays, as many at a time as a renderer would have at hand.
fn ours_at_once(bvh: &Bvh, set: &Set) -> Round {
    let (mut answers, mut blocked) = ([None; AT_ONCE], [false; AT_ONCE]);
    let start = ThreadTime::now();
    let mut hits = 0;
    let mut sum = 0.0f64;
    for rays in set.rays.chunks(AT_ONCE) {
        if set.any {
            bvh.occluded_each(rays, &mut blocked);
            hits += blocked[..rays.len()].iter().filter(|b| **b).count() as u64;
        } else {
            bvh.closest_each(rays, &mut answers);
            for hit in answers[..rays.len()].iter().flatten() {
                hits += 1;
                sum += f64::from(hit.t);
            }
        }
    }
    std::hint::black_box(sum);
    Round { seconds: start.elapsed().as_secs_f64(), hits }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn main() -> Outcome<()> {
    let rounds: usize = env::var("RAYS_ROUNDS").map_or(Ok(9), |r| r.parse())?;
    let scenes = env::var("RAYS_SCENES").unwrap_or_else(|_| "32 70k 1m".into());
    let mut ratios = Vec::new();
    println!("scene  set      rays     ours Mray/s  at once / one by one  Embree Mray/s  ratio (quartiles)    misses ours / Embree");
    for name in scenes.split_whitespace() {
        let mesh = workload::scene(name).ok_or_else(|| format!("no scene {name}"))?;
        let primitives: Vec<_> = mesh.soup().map(Primitive::Triangle).collect();
        let start = ThreadTime::now();
        let bvh = Bvh::build(&primitives);
        let built = start.elapsed().as_secs_f64();
        drop(primitives);
        let work = workload::Workload::new(name, mesh, &bvh);
        let mut embree = Embree::start(&work)?;
        for (k, set) in work.sets.iter().enumerate() {
            let mut both = (Vec::new(), Vec::new(), Vec::new());
            let mut at_once = Vec::new();
            let mut last = (Round::default(), None);
            for round in 0..rounds {
                // Who goes first changes, so that neither always finds the clock or the caches in the other's state.
                let mut theirs = None;
                if round % 2 == 0 {
                    theirs = embree.as_mut().map(|e| e.run(k)).transpose()?;
                }
                let mine = ours(&bvh, set);
                if round % 2 == 1 {
                    theirs = embree.as_mut().map(|e| e.run(k)).transpose()?;
                }
                let together = ours_at_once(&bvh, set);
                if together.hits != mine.hits {
                    return Err(format!("{name} {}: {} hits at once, {} one by one", set.name, together.hits, mine.hits).into());
                }
                at_once.push(mine.seconds / together.seconds);
                both.0.push(mine.seconds);
                if let Some(theirs) = theirs {
                    both.1.push(theirs.seconds);
                    both.2.push(theirs.seconds / mine.seconds);
                }
                last = (mine, theirs);
            }
            let rate = |seconds| set.rays.len() as f64 / 1e6 / median(seconds);
            let n = set.rays.len() as u64;
            let (mine, theirs) = last;
            print!("{name:6} {:8} {n:8} {:8.2}  {:8.2}", set.name, rate(both.0), median(at_once));
            if let Some(theirs) = theirs {
                let mut sorted = both.2.clone();
                sorted.sort_by(f64::total_cmp);
                let ratio = median(both.2);
                let quartiles = [sorted[sorted.len() / 4], sorted[sorted.len() * 3 / 4]];
                print!(
                    "     {:8.2}       {ratio:.2} ({:.2} - {:.2})    {} / {}",
                    rate(both.1),
                    quartiles[0],
                    quartiles[1],
                    n - mine.hits,
                    n - theirs.hits
                );
                if !set.name.starts_with("edges") {
                    ratios.push(ratio);
                }
            }
            println!();
        }
        println!(
            "{name:6} built in {built:.2} s, {:.1} MiB, bounds {:?}",
            bvh.memory() as f64 / f64::from(1 << 20),
            bvh.bounds().map(|b| b.max - b.min)
        );
        if let Some(embree) = embree {
            embree.stop()?;
        }
    }
    if ratios.is_empty() {
        println!("Embree's side was skipped: start with tests/bench/rays/run.sh");
    } else {
        let mean = (ratios.iter().map(|r| r.ln()).sum::<f64>() / ratios.len() as f64).exp();
        let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
        println!("geometric mean {mean:.3}, least {least:.3}");
    }
    Ok(())
}
