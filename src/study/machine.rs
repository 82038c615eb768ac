//! What a study runs on, and when.

use super::records::Machine;
use std::time::SystemTime;
use sysinfo::{CpuRefreshKind, MemoryRefreshKind, RefreshKind, System};

/// This machine, with so many threads in use.
pub fn machine(threads: usize) -> Machine {
    let wanted = RefreshKind::nothing().with_cpu(CpuRefreshKind::nothing()).with_memory(MemoryRefreshKind::nothing().with_ram());
    let system = System::new_with_specifics(wanted);
    Machine {
        cpu: system.cpus().first().map_or_else(String::new, |cpu| cpu.brand().trim().to_owned()),
        processors: std::thread::available_parallelism().map_or(0, usize::from),
        threads,
        os: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        memory: Some(system.total_memory()).filter(|bytes| *bytes > 0),
    }
}

/// Date and time, UTC, RFC 3339, to the second.
pub fn now() -> String {
    humantime::format_rfc3339_seconds(SystemTime::now()).to_string()
}
