#!/usr/bin/env bash
# Runs a real Blender application: with its windows, and in the background.
#
#   tests/app/application.sh blender ARGUMENTS...   Blender without a window system
#   tests/app/application.sh window ARGUMENTS...    Blender in a window; on a virtual screen where
#                                                   there is no DISPLAY
#   tests/app/application.sh headset ARGUMENTS...   the same with a simulated VR headset: its picture, both
#                                                   eyes side by side, stands at the top left of the
#                                                   screen, Blender's window to the right of it
#   tests/app/application.sh run COMMAND...         anything else beside it (`import` of ImageMagick)
#   tests/app/application.sh remove                 delete the folder that was made
#
# Which Blender:
#   BLENDER=/path/to/blender   your own, on any system; it needs Xvfb for `window` without a DISPLAY, and
#                              Xvfb, a Vulkan driver and the OpenXR runtime Monado for `headset`.
#   otherwise                  as root on Debian or its kin, the newest one of Debian, in a folder of its
#                              own that nothing else sees: $SPECTRAL_BOOTH_APP_ROOT, or .blender-app in the
#                              project. It is made at the first call (a few minutes, 2.5 GB), from the
#                              mirror that this machine's apt uses.
# The current folder is the only one that Blender sees under the same path there: keep files below it.
set -euo pipefail

project=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
root=${SPECTRAL_BOOTH_APP_ROOT:-$project/.blender-app}
packages=(blender xvfb imagemagick libegl1 libgl1 libgl1-mesa-dri
  monado-service libopenxr1-monado libopenxr-loader1 mesa-vulkan-drivers
  python3-numpy python3-openimageio python3-requests python3-zstandard python3-jsonschema python3-cattr)

stop() {
  echo "error: $*" >&2
  exit 2
}

mirror() { # the first one in apt's own lists, in either of their two formats
  local lists=(/etc/apt/sources.list /etc/apt/sources.list.d/*) # the first is missing on newer systems
  { sed -nE 's/^URIs:[[:space:]]*([^[:space:]]+).*/\1/p; s/^deb[[:space:]]+(\[[^]]*\][[:space:]]+)?([^[:space:]]+).*/\2/p' \
    "${lists[@]}" 2>/dev/null || true; } | head -n 1
}

within() { # a command inside the folder; what is mounted for it goes away with it
  [[ $(id -u) == 0 ]] || stop "Blender in $root needs root; set BLENDER to an installed one instead"
  mkdir -p "$root$PWD"
  unshare --mount --propagation private bash -c '
    set -e
    mount --rbind /dev "$1/dev"
    mount -t proc proc "$1/proc"
    mount --bind "$2" "$1$2"
    root=$1 folder=$2
    shift 2
    exec chroot "$root" env --chdir="$folder" HOME=/root TMPDIR=/tmp LC_ALL=C.UTF-8 "$@"' within "$root" "$PWD" "$@"
}

make_root() {
  [[ $(id -u) == 0 ]] && command -v apt-get >/dev/null ||
    stop "no Blender here; install Blender 4.5 or newer and set BLENDER to its executable"
  command -v debootstrap >/dev/null || { apt-get -qq update && apt-get -qq install -y debootstrap; } >&2
  local from
  from=$(mirror)
  [[ -n $from ]] || stop "apt's lists name no mirror; set BLENDER to an installed Blender"
  echo "making Blender in $root (once)" >&2
  rm -rf "$root.part"
  debootstrap --variant=minbase sid "$root.part" "$from" >&2
  (
    root=$root.part
    within env DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends "${packages[@]}" >&2
  )
  mv "$root.part" "$root"
}

inside() { # a command beside Blender, wherever that is
  if [[ -n ${BLENDER:-} ]]; then "$@"; else
    [[ -d $root ]] || make_root
    within "$@"
  fi
}

on_screen() { # WIDTH COMMAND...: the command on a virtual screen of its own; Xvfb says which number is free
  inside bash -c '
    export XDG_RUNTIME_DIR=$(mktemp -d)
    numbers=$XDG_RUNTIME_DIR/number
    mkfifo "$numbers"
    Xvfb -displayfd 3 -screen 0 "$1x1000x24" +extension GLX 3>"$numbers" >/dev/null 2>&1 &
    screen=$!
    read -r number <"$numbers"
    shift
    status=0
    DISPLAY=:$number "$@" || status=$?
    kill "$screen"
    exit "$status"' on_screen "$@"
}

# Monado draws what its headset shows into a window, at the top left where there is no window manager. Its
# standard input must stay open, and it outlives a polite signal. The service that answers must be ours, so
# that it is waited for: its socket appears when it is ready.
with_monado='
  command -v monado-service >/dev/null || { echo "error: no monado-service here; install Monado, or remove the folder that was made" >&2; exit 2; }
  mkfifo "$XDG_RUNTIME_DIR/stdin"
  exec 9<>"$XDG_RUNTIME_DIR/stdin"
  export XR_RUNTIME_JSON=${XR_RUNTIME_JSON:-/usr/share/openxr/1/openxr_monado.json}
  XRT_COMPOSITOR_FORCE_XCB=1 SIMULATED_ENABLE=1 monado-service <&9 >"$XDG_RUNTIME_DIR/monado.log" 2>&1 &
  headset=$!
  for _ in $(seq 100); do
    [[ -S $XDG_RUNTIME_DIR/monado_comp_ipc ]] && break
    sleep 0.1
  done
  status=0
  "$@" 9>&- || status=$?
  kill -9 "$headset"
  exit "$status"'

blender=${BLENDER:-blender}
verb=${1:-}
[[ -n $verb ]] && shift
case $verb in
blender) inside "$blender" "$@" ;;
run) inside "$@" ;;
window)
  if [[ -n ${DISPLAY:-} && -n ${BLENDER:-} ]]; then
    "$blender" "$@"
  else
    on_screen 1600 "$blender" --window-geometry 0 0 1600 1000 "$@"
  fi
  ;;
headset)
  on_screen 2400 bash -c "$with_monado" headset "$blender" -noaudio --window-geometry 800 0 1600 1000 "$@"
  ;;
remove) rm -rf "$root" ;;
*) sed -n '2,/^set/{/^set/d;s/^# \{0,1\}//p}' "${BASH_SOURCE[0]}" >&2; exit 2 ;;
esac
