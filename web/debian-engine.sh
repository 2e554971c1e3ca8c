#!/bin/sh
# Builds the engine where rustup cannot fetch the target wasm32-unknown-unknown, on Debian 12 with
# its security updates: with the compiler that Debian has for web browsers (rustc-web), which also
# builds the standard library. Needs apt, 1 GB in build/debian, cargo and rust-lld of a Rust 1.91 or
# later (`LINKER` names another one). Installs nothing.
set -eu
cd "$(dirname "$0")"
mkdir -p build/debian
folder=$PWD/build/debian
sysroot=$(rustc --print sysroot)
linker=${LINKER:-$(find "$sysroot/lib/rustlib" -name rust-lld | head -n 1)}
[ -x "$linker" ] || { echo "missing: rust-lld in $sysroot; set LINKER to a linker for WebAssembly" >&2; exit 1; }
version=$(apt-cache policy rustc-web | sed -n 's/^  Candidate: //p')
[ -n "$version" ] || { echo 'missing: the package rustc-web, of Debian 12 with its security updates' >&2; exit 1; }
library=libstd-rust-web-$(echo "$version" | cut -d. -f1,2)
llvm=$(apt-cache depends "$library=$version" | sed -n 's/^ *Depends: \(libllvm.*\)/\1/p')
(
    cd "$folder"
    apt-get download "$llvm" "$library=$version" "libstd-rust-web-dev=$version" \
        "rustc-web=$version" "rust-web-src=$version"
    for package in *.deb; do
        dpkg -x "$package" .
        rm "$package"
    done
)
cat >"$folder/rustc" <<END
#!/bin/sh
LD_LIBRARY_PATH=$folder/usr/lib/x86_64-linux-gnu exec $folder/usr/bin/rustc "\$@"
END
chmod +x "$folder/rustc"
RUSTC=$folder/rustc RUSTC_BOOTSTRAP=1 CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=$linker \
    CARGO_BUILD_ARGS='-Z build-std=std,panic_abort' exec node build-engine.mjs
