//! Does this processor have the instructions that the program was compiled with?

use std::process::ExitCode;

/// Which of the instruction sets that this program was compiled with are missing; `None` if it can run.
///
/// `is_x86_feature_detected!` is no use here: for a feature enabled at compile time it is the constant `true`. This asks the processor, and uses
/// nothing but comparisons that every x86-64 processor has: it must run before anything else.
#[cfg(all(target_arch = "x86_64", target_feature = "avx2"))]
#[inline(never)]
pub fn missing() -> Option<&'static str> {
    use std::arch::x86_64::__cpuid_count;
    const FMA: u32 = 1 << 12;
    const BMI1_AVX2_BMI2: u32 = 1 << 3 | 1 << 5 | 1 << 8;
    let most = __cpuid_count(0, 0).eax;
    let basic = __cpuid_count(1, 0).ecx;
    let extended = if most >= 7 { __cpuid_count(7, 0).ebx } else { 0 };
    (basic & FMA != FMA || extended & BMI1_AVX2_BMI2 != BMI1_AVX2_BMI2).then_some("AVX2, FMA, BMI1 and BMI2")
}

/// Which of the instruction sets that this program was compiled with are missing: nothing was asked for beyond the target's own.
#[cfg(not(all(target_arch = "x86_64", target_feature = "avx2")))]
pub fn missing() -> Option<&'static str> {
    None
}

/// Says what to do instead.
#[cold]
pub fn refuse(features: &str) -> ExitCode {
    eprintln!("error: this program was compiled for processors with {features}, and this one lacks some of them");
    eprintln!("help: build one for every x86-64 processor, slower: RUSTFLAGS=\"-C target-cpu=x86-64\" cargo build --release");
    ExitCode::from(2)
}
