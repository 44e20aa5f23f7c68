# Lists and installs the Debian packages that the lane needs on this machine. Sourced by ../run.

# By line: emulator and initramfs; tools that build two kernel modules (objtool needs libelf1);
# third-party clients, including udev.
packages=(
  qemu-system-x86 busybox-static cpio kmod
  gcc make libc6-dev libelf1
  v4l-utils ffmpeg gstreamer1.0-tools gstreamer1.0-plugins-base gstreamer1.0-plugins-good
  python3 python3-opencv python3-serial udev usbip usbutils
)

# Prints the packages that are not installed.
missing_packages() {
  local package
  for package in "${packages[@]}"; do
    [ "$(dpkg-query -W -f '${db:Status-Status}' "$package" 2> /dev/null)" = installed ] || echo "$package"
  done
}

install_packages() {
  local sudo=() missing
  mapfile -t missing < <(missing_packages)
  [ ${#missing[@]} -gt 0 ] || return 0
  [ "$(id -u)" -eq 0 ] || sudo=(sudo)
  "${sudo[@]}" apt-get update -qq || fail 'apt-get update: see above'
  DEBIAN_FRONTEND=noninteractive "${sudo[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}" ||
    fail "apt-get install: see above; wanted ${missing[*]}"
}

require_packages() {
  local missing
  command -v dpkg-query > /dev/null || fail 'this is no Debian: the lane boots the kernel of its packages'
  mapfile -t missing < <(missing_packages)
  [ ${#missing[@]} -eq 0 ] || fail "packages are missing: ${missing[*]} (tests/kernel/run --install installs them)"
}
