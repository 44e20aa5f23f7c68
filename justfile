# The commands that a developer of the project types most. `just --list` explains them.

# One crate's tests: just test decode, or just test decode phase
test crate name="":
    cargo test --release -p phasmid-{{crate}} {{name}}

# One test of the program or of whole devices: just e2e demo::
e2e name:
    cargo test --release --test end_to_end -- {{name}}

# Format, wording, lints, documentation and unit tests
quick:
    .ci/run --quick

# What must pass before a change lands
check:
    .ci/run

# Lints of everything
lint:
    cargo fmt --all
    cargo clippy --release --workspace --all-targets -- -D warnings
    .ci/words
    .ci/crates

# Rewrite the generated pages of the book after a change of comments, fields or help
book:
    PHASMID_BLESS=1 cargo test --release --test end_to_end book::

# A benchmark beside its yardstick: just bench passes
bench name:
    cargo bench --bench {{name}}

# The main job
demo *arguments:
    cargo run --release -- demo {{arguments}}

# The program to hand out: target/dist/phasmid
dist:
    cargo build --locked --profile dist

# The container image's last stage, tested in a chroot; needs root
container:
    cargo build --release --locked
    tests/container/run

# The programs in examples, as tests
examples:
    cargo test --release --examples

# The documentation of the library in a browser
doc:
    cargo doc --release --workspace --no-deps --open
