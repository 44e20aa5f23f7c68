# Boots the guest and follows what its tests report. Sourced by ../run.

# boot FILTER...: boots a guest; prints the lines of its tests and writes them to $out/report.
# Returns the guest's exit status, or 125 if it reported none.
boot() {
  local status
  : > "$out/console.log"
  printf '%s\n' "$@" > "$out/filters"
  # The first serial port is the kernel's console, the second carries the report. The guest mounts
  # this machine's root read-only to use its programs. The checkout is mounted separately, because
  # it may be in /tmp, which the guest replaces.
  timeout -k 5 "$limit_s" qemu-system-x86_64 \
    -accel tcg,thread=multi -cpu max -smp 2 -m 2048 -nodefaults -no-reboot -display none \
    -kernel "$stock/root/boot/vmlinuz-$kernel" -initrd "$stock/initramfs.cpio" \
    -append 'console=ttyS0 quiet panic=-1 no_timer_check' \
    -serial "file:$out/console.log" -serial stdio \
    -virtfs local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap \
    -virtfs "local,path=$repo,mount_tag=repo,security_model=none,readonly=on,multidevs=remap" \
    -virtfs "local,path=$out,mount_tag=out,security_model=none,multidevs=remap" \
    < /dev/null | sed -u 's/\r$//' | while IFS= read -r line; do
      if [ "$line" = begins ]; then
        say "the first test begins after $((SECONDS - begun)) s"
      else
        printf '%s\n' "$line"
      fi
    done | tee "$out/report"
  status=${PIPESTATUS[0]}
  if [ "$status" -eq 124 ] || [ "$status" -eq 137 ]; then
    say "the guest hung: killed after $limit_s s"
  elif [ "$status" -ne 0 ]; then
    say "QEMU ended with status $status"
  fi
  status=$(sed -n 's/^exit-status: //p' "$out/report" | tail -n 1)
  return "${status:-125}"
}
