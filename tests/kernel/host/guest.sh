# Boots the guest and follows what its tests report. Sourced by ../run.

# boot FILTER...: one guest; its tests' lines go to standard output and $out/report. Status: the
# guest's own, 125 when it did not report one.
boot() {
  local status
  : > "$out/console.log"
  printf '%s\n' "$@" > "$out/filters"
  # The first serial port is the kernel's console, the second is the report. Root is this machine's,
  # for its programs, read-only; the checkout has a mount of its own, so that it may lie in /tmp.
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
