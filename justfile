# All checks that every change must pass; installs nothing outside target/
check:
    bash .ci/check

# The same, and checks that take too long for every change
full:
    bash .ci/full

# The documentation as a site, in target/book; needs mdbook
book:
    mdbook build

# Benchmarks; copy the results to docs/performance.md
bench:
    cargo bench --bench walk --bench slab

# Renew the instruction counts that `just check` compares with
instructions:
    cargo build --release
    bash .ci/instructions --update

# Regenerate the committed schemas, messages and seeds
golden:
    UPDATE_GOLDEN=1 cargo test --release

# Regenerate the figures of docs/validation.md and its numbers
figures:
    cargo run --release -- study configs/studies --out docs/validation
    UPDATE_GOLDEN=1 cargo test --release --test pipeline pages::numbers_of_validation

# Regenerate docs/judge and the tables of docs/measurements.md
judge:
    cargo run --release --example judge -- docs/judge
    UPDATE_GOLDEN=1 cargo test --release --test pipeline pages::tables_of_measurements

# Regenerate everything that depends on the default model, except the pictures of
# docs/mitsuba.md (examples/mitsuba): some hours on two cores
renew:
    rm -f tests/data/golden.csv
    cargo run --release --example golden -- "$(date +%F)"
    cargo run --release --example stability -- docs
    cargo run --release --example goniometer > docs/goniometer.csv
    just figures peers picture swatches quoted judge
    cargo run --release -- tradeoff --database out/thesis --seeds 8 --truth-engine tabulated \
        --truth-rays 1600000 --budget 700 --out docs
    UPDATE_GOLDEN=1 cargo test --release --test pipeline

# Test the extension in Blender (bpy 4.5 and 5.2; needs Python 3.11 and 3.13)
blender:
    tests/blender/run

# Regenerate the pictures of docs/blender.md: half an hour on two cores, after `just blender`
gallery:
    target/blender-5.2/bin/python -m pip install --quiet pillow
    target/blender-5.2/bin/python examples/blender/gallery.py --out out/gallery
    for name in blocks igloo sculpture lantern; do cp out/gallery/$name.png docs/blender_$name.png; done

# Regenerate the pictures of docs/mitsuba.md; needs the Python packages splitsnow, mitsuba,
# pyoidn and pillow, and ten minutes of processor time
mitsuba:
    python examples/mitsuba/blocks.py --size 1440 --spp 256 --variant llvm_ad_rgb --denoise
    python examples/mitsuba/soot.py --size 1440 --spp 256 --variant llvm_ad_rgb --denoise
    python examples/mitsuba/sculpture.py --size 1920 --spp 256 --variant llvm_ad_rgb --denoise
    python examples/mitsuba/igloo.py --size 1440 --spp 64 --variant llvm_ad_rgb --denoise
    cp out/blocks.png docs/mitsuba.png
    cp out/soot.png docs/mitsuba_soot.png
    cp out/sculpture.png docs/mitsuba_sculpture.png
    python -c "from PIL import Image; Image.open('out/igloo.png').convert('RGB').quantize(256, method=1, kmeans=8, dither=0).save('docs/mitsuba_igloo.png', optimize=True)"

# Regenerate the curves, pictures and tables of docs/peers.md
peers:
    for sample in clean soot_in_pores soot_in_ice thin; do \
        cargo run --release -- simulate examples/peers/$sample.toml > examples/peers/data/$sample.csv; \
    done
    for sample in profile_clean profile_soot; do \
        cargo run --release -- simulate examples/peers/$sample.toml --depths-cm 0:1:0.05,1:30:0.5 \
            > examples/peers/data/$sample.csv; \
        for bands in par broadband:total; do \
            cargo run --release -- simulate examples/peers/$sample.toml --depths-cm 0,1,5,10,20,30 \
                --bands $bands > examples/peers/data/${sample}_${bands%%:*}.csv; \
        done; \
    done
    cargo run --release --example kernel -- examples/peers/clean.toml > examples/peers/data/kernel.csv
    for sun in astm_global astm_direct subarctic_winter; do \
        cargo run --release -- simulate examples/peers/clean.toml --bands broadband --sun $sun \
            > examples/peers/data/broadband_$sun.csv; \
    done
    python3 -m venv target/peers
    target/peers/bin/pip install -r examples/peers/requirements.txt
    target/peers/bin/python examples/peers/tartes_albedo.py --out docs/peers
    target/peers/bin/python examples/peers/tartes_profile.py --out docs/peers
    target/peers/bin/python examples/peers/disort.py --out docs/peers
    target/peers/bin/python examples/peers/broadband.py
    UPDATE_GOLDEN=1 cargo test --release --test pipeline pages::tables_beside

# Regenerate the picture of the README
picture:
    cargo run --release --example readme_picture

# Regenerate docs/quoted.csv and the numbers that pages quote from it
quoted:
    cargo build --release
    bash examples/quoted/make.sh out/quoted
    cargo run --release --example quoted -- out/quoted docs/quoted.csv
    UPDATE_GOLDEN=1 cargo test --release --test pipeline pages::marked

# Regenerate docs/swatches.md and its pictures
swatches:
    cargo run --release -- build configs/thesis.toml
    cargo run --release --example swatches -- out/thesis docs
