# Everything a change must pass
check:
    bash .ci/run

# And what takes too long for every change
full:
    bash .ci/full

# Benchmarks; results go to docs/performance.md
bench:
    cargo bench --bench walk --bench slab

# Committed schemas, messages and seeds made anew
golden:
    UPDATE_GOLDEN=1 cargo test --release

# The figures of docs/validation.md
figures:
    cargo run --release -- study configs/studies --out docs/validation

# The picture of the README
picture:
    cargo run --release --example readme_picture

# The swatches of docs/swatches.md
swatches:
    cargo run --release -- build configs/thesis.toml
    cargo run --release --example swatches -- out/thesis docs
