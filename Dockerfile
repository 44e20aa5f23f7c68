# Phasmid in a container. It needs no privileges, devices or capabilities.
#
#   docker build --tag phasmid .
#   docker run --rm phasmid demo
#
# Keep the output: mount a folder over /work, and run as its owner.
#
#   docker run --rm --volume "$PWD:/work" --user "$(id -u):$(id -g)" phasmid demo
#
# Serve a scanner, and scan it in the same container. The run directory must be in the container,
# because `control` is a pseudo-terminal, which exists only there.
#
#   docker run --rm --name scanner phasmid serve --run-dir run
#   docker exec scanner phasmid scan --run-dir run --out scan
#
# Reach the scanner from outside, camera and control port, over USB/IP. It has no authentication:
# publish the port on the loopback interface only.
#
#   docker run --rm --publish 127.0.0.1:3240:3240 phasmid serve --usb export --usb-listen 0.0.0.0:3240
#   phasmid scan --device usb:127.0.0.1:3240
#
# `--tcp PORT` serves frames on the loopback interface of the container, which `--publish` does not
# reach. Use it with `--network host`, or from a container started with `--network container:scanner`.
#
# For `--backend gpu`, install a Vulkan driver, for example Mesa's software driver:
#
#   docker build --build-arg PACKAGES="libvulkan1 mesa-vulkan-drivers" --tag phasmid .
#
# `tests/container/run` runs the last stage in a chroot and tests it, without a container builder.

FROM rust:1-slim-bookworm AS build
WORKDIR /src
COPY . .
RUN cargo build --locked --profile dist --bin phasmid

# The same Debian release as above: the program needs a C library at least as new as the one that it
# was built with.
FROM debian:bookworm-slim
# Debian packages to add. The program needs none: it links libc6 and libgcc-s1, which the base has.
ARG PACKAGES=""
RUN if [ -n "$PACKAGES" ]; then \
      apt-get update && \
      apt-get install --yes --no-install-recommends $PACKAGES && \
      rm -rf /var/lib/apt/lists/*; \
    fi
# /work is writable for every user, so that `--user` works without a volume.
RUN useradd --uid 1000 --home-dir /work --no-create-home --shell /usr/sbin/nologin phasmid && \
    install --directory --owner phasmid --group phasmid --mode 1777 /work
COPY LICENSE-MIT LICENSE-APACHE /usr/share/doc/phasmid/
COPY --from=build /src/target/dist/phasmid /usr/local/bin/phasmid
USER phasmid
WORKDIR /work
ENTRYPOINT ["phasmid"]
