#!/usr/bin/env bash
# Makes bindings.rs anew from this machine's linux/videodev2.h (Debian: linux-libc-dev).
# Needs `cargo install bindgen-cli` and libclang; the build of the program needs neither.
set -euo pipefail
cd "$(dirname "$0")"
header=$(mktemp --suffix .h)
trap 'rm -f "$header"' EXIT
echo '#include <linux/videodev2.h>' > "$header"
bindgen "$header" --output bindings.rs --no-layout-tests --no-doc-comments \
  --allowlist-type 'v4l2_.*' --allowlist-type time_t --allowlist-var 'V4L2_.*' --rust-edition 2018
