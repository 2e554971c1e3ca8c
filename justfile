# Everything a change must pass
check:
    bash .ci/run

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
