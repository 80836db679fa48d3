//! `particlegs-wasm-test MODEL PICTURES`: the native side, without vector instructions.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let [model, out] =
        std::env::args_os().skip(1).collect::<Vec<_>>().try_into().map_err(|_| "two paths are wanted")?;
    let pictures =
        particlegs_wasm_test::pictures(&std::fs::read(model)?, &particlegs_core::context::Context::scalar())?;
    Ok(std::fs::write(out, pictures)?)
}
