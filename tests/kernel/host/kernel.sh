# Prepares a stock Debian kernel, v4l2loopback for it, our own module, and an initramfs that
# contains them, in $cache/KERNEL-VERSION. The kernel and v4l2loopback are prepared only once.
# Sourced by ../run.

# Kernel modules that the guest loads at boot, in this order, each after its dependencies. vivid and
# the USB drivers are loaded by the tests that need them.
boot_modules=(virtio_pci 9p 9pnet_virtio videodev)
vivid_modules=(vivid)
usb_modules=(vhci-hcd uvcvideo cdc-acm)

# Sets $kernel and $stock. Uses the newest kernel in the cache; if there is none, the kernel that
# apt offers.
choose_kernel() {
  local ready
  ready=$(find "$cache" -mindepth 2 -maxdepth 2 -name ready 2> /dev/null | sort -V | tail -n 1)
  if [ -n "$ready" ]; then
    kernel=$(basename "$(dirname "$ready")")
  else
    kernel=$(apt-cache depends linux-image-amd64 2> /dev/null | sed -n 's/.*Depends: linux-image-//p' | head -n 1)
    [ -n "$kernel" ] || fail 'apt knows no linux-image-amd64: not a Debian for amd64, or apt-get update was never run'
  fi
  stock=$cache/$kernel
}

# Fetches the packages of the kernel without installing them.
download_kernel() {
  local kbuild options=(-qq)
  # As root, apt would download as another user, who may not have write access here.
  [ "$(id -u)" -ne 0 ] || options+=(-o APT::Sandbox::User=root)
  kbuild=$(apt-cache depends "linux-headers-$kernel" | sed -n 's/.*Depends: \(linux-kbuild-.*\)/\1/p')
  mkdir -p "$stock/debs"
  (cd "$stock/debs" && apt-get download "${options[@]}" "linux-image-$kernel" "linux-headers-$kernel" \
    "linux-headers-${kernel%-amd64}-common" "$kbuild" v4l2loopback-dkms) ||
    fail "the packages of kernel $kernel cannot be downloaded: see above; on a machine that is offline $cache has to be full"
  local deb
  for deb in "$stock"/debs/*.deb; do dpkg -x "$deb" "$stock/root"; done
  rm -rf "$stock/debs"
  depmod -b "$stock/root" "$kernel"
}

# build_module FOLDER NAME: builds module NAME in FOLDER and copies it to $stock.
build_module() {
  local headers=$stock/root/usr/src/linux-headers-$kernel
  # The package's makefile includes another makefile by its installed path.
  echo "include $stock/root/usr/src/linux-headers-${kernel%-amd64}-common/Makefile" > "$headers/Makefile"
  make -s -C "$headers" M="$1" CC=gcc modules > "$stock/build.log" 2>&1 ||
    { cat "$stock/build.log" >&2; fail "module $2 does not build against kernel $kernel"; }
  cp "$1/$2.ko" "$stock/"
}

# Prepares everything that does not depend on this checkout.
make_stock() {
  [ ! -e "$stock/ready" ] || return 0
  say "making kernel $kernel ready in $stock"
  rm -rf "$stock"
  download_kernel
  mkdir -p "$stock/build"
  cp -r "$stock"/root/usr/src/v4l2loopback-*/. "$stock/build/"
  echo 'obj-m := v4l2loopback.o' > "$stock/build/Kbuild"
  build_module "$stock/build" v4l2loopback
  rm -rf "$stock/build"
  touch "$stock/ready"
}

# Builds our own module if its source is newer.
make_unplug() {
  [ "$stock/unplug.ko" -nt "$lane/unplug/unplug.c" ] && return 0
  rm -rf "$stock/unplug" && cp -r "$lane/unplug" "$stock/unplug"
  build_module "$stock/unplug" unplug
}

# Makes the initramfs: busybox, modules in load order, and init. It is quick, so every run makes it.
make_initramfs() {
  local tree=$stock/initramfs module
  rm -rf "$tree" && mkdir -p "$tree"/{bin,modules,proc,sys,dev,host}
  cp "$(command -v busybox)" "$tree/bin/busybox"
  cp "$lane/guest/init" "$tree/init"
  cp "$stock/v4l2loopback.ko" "$stock/unplug.ko" "$tree/modules/"
  module_files "${boot_modules[@]}" > "$tree/boot-order"
  module_files "${vivid_modules[@]}" | grep -vxFf "$tree/boot-order" > "$tree/modules/vivid-order"
  module_files "${usb_modules[@]}" | grep -vxFf "$tree/boot-order" > "$tree/modules/usb-order"
  for module in $(sort -u "$tree/boot-order" "$tree"/modules/*-order); do
    cp "$(find "$stock/root/lib/modules/$kernel" -name "$module")" "$tree/modules/"
  done
  (cd "$tree" && find . | cpio --quiet -o -H newc) > "$stock/initramfs.cpio"
}

# Prints the file names of modules and their dependencies, in load order.
module_files() {
  local module
  for module in "$@"; do
    modprobe -d "$stock/root" -S "$kernel" --show-depends "$module" | awk '/^insmod/ {print $2}' | xargs -n 1 basename
  done | awk '!seen[$0]++'
}
