#!/bin/sh
# Installs the wheel that ./dev wheel built in bare Debian roots, which have their own Python and
# nothing else, and runs tests/python/bare_root.py there: the closed loop without an OpenCL device,
# and with images by PoCL, of the extra boresight[pocl] and of Debian.
#
#     bare_root.sh [SUITE...]     Debian releases; default: bookworm trixie
#
# Needs root, debootstrap and a network, and BORESIGHT_TEST_NETWORK=1 in the environment; ends with
# 77 (skipped) otherwise. BORESIGHT_MIRROR: a Debian mirror, by default that of apt here.
# BORESIGHT_ROOTS: a folder where bare roots are kept for the next time. pip obeys the PIP_
# variables of the environment.
set -eu

sources=$(CDPATH='' cd -- "$(dirname -- "$0")/../.." && pwd -P)

skip() {
    printf '%s\n' "skipped: $*"
    exit 77
}

[ -n "${BORESIGHT_TEST_NETWORK:-}" ] || skip "needs a network: set BORESIGHT_TEST_NETWORK=1"
[ "$(id -u)" -eq 0 ] || skip "needs root"
command -v debootstrap >/dev/null || skip "needs debootstrap"
unshare --mount true 2>/dev/null || skip "may not mount file systems"
wheel=$(ls -t "$sources"/dist/boresight-*.whl 2>/dev/null | head -n 1)
[ -n "$wheel" ] || skip "no wheel in dist: run ./dev wheel"

mirror=${BORESIGHT_MIRROR:-$(apt-get indextargets --format '$(CODENAME) $(REPO_URI)' \
    'Created-By: Packages' | awk '$1 !~ /-/ { print $2; exit }')}
[ -n "$mirror" ] || skip "apt has no Debian mirror: set BORESIGHT_MIRROR"

work=$(mktemp -d "${TMPDIR:-/var/tmp}/bare_root.XXXXXX")
trap 'rm -rf --one-file-system "$work"' EXIT INT TERM

# make_root SUITE: a new bare root in $root.
make_root() {
    kept=${BORESIGHT_ROOTS:+$BORESIGHT_ROOTS/$1}
    root=$work/$1
    if [ -n "$kept" ] && [ -f "$kept.tar" ]; then
        mkdir "$root"
        tar -C "$root" -xf "$kept.tar"
        return
    fi
    debootstrap --variant=minbase --include=python3,python3-venv,ca-certificates "$1" "$root" \
        "$mirror" >"$work/debootstrap.log" 2>&1 || {
        tail -n 20 "$work/debootstrap.log"
        exit 1
    }
    if [ -n "$kept" ]; then
        mkdir -p "$BORESIGHT_ROOTS"
        tar -C "$root" -cf "$kept.tar" .
    fi
}

# enter COMMAND...: runs a command in the root, with the devices of this machine.
enter() {
    # shellcheck disable=SC2016 # expanded inside
    unshare --mount --propagation private sh -eu -c '
        root=$1
        shift
        mount --bind /proc "$root/proc"
        mount --bind /sys "$root/sys"
        mount --bind /dev "$root/dev"
        exec chroot "$root" env -u PYTHONPATH -u LD_LIBRARY_PATH HOME=/root PATH=/usr/bin:/bin:/usr/sbin:/sbin "$@"
    ' enter "$root" "$@"
}

seconds() { date +%s.%N; }

# timed NAME COMMAND...: runs a command in the root and says how long it took, and how much
# processor time, user and system.
timed() {
    name=$1 from=$(seconds)
    shift
    (
        enter "$@"
        times >"$work/times"
    )
    elapsed=$(echo "$(seconds) $from" | awk '{ printf "%.1f", $1 - $2 }')
    processor=$(sed -n '2s/[ms]/ /gp' "$work/times" | awk '{ printf "%.1f", 60 * ($1 + $3) + $2 + $4 }')
    echo "$suite: $name: $elapsed s, $processor s of a processor"
}

try_suite() {
    suite=$1
    make_root "$suite"
    cp /etc/resolv.conf "$root/etc/resolv.conf"
    # the certificates that pip trusts here
    for file in "${PIP_CERT:-}" "${SSL_CERT_FILE:-}"; do
        if [ -f "$file" ]; then
            mkdir -p "$root$(dirname -- "$file")"
            cp "$file" "$root$file"
        fi
    done
    mkdir "$root/try"
    cp "$wheel" "$sources/tests/python/bare_root.py" "$root/try"
    file=/try/$(basename -- "$wheel")
    enter python3 -m venv /try/plain
    timed "pip install" /try/plain/bin/pip install --quiet "$file"
    timed "closed loop without a device" /try/plain/bin/python /try/bare_root.py generator
    enter python3 -m venv /try/extra
    timed "pip install with pocl" /try/extra/bin/pip install --quiet "$file[pocl]"
    timed "closed loop to the picture" /try/extra/bin/python /try/bare_root.py picture /try/frame.png
    timed "the same again" /try/extra/bin/python /try/bare_root.py picture
    enter sh -c 'apt-get -qq update && DEBIAN_FRONTEND=noninteractive apt-get -qq install -y \
        --no-install-recommends pocl-opencl-icd >/dev/null 2>&1'
    timed "closed loop with Debian's PoCL" /try/plain/bin/python /try/bare_root.py picture
    rm -rf --one-file-system "$root"
}

echo "wheel: $(basename -- "$wheel"), $(du -m "$wheel" | cut -f1) MiB"
[ $# -gt 0 ] || set -- bookworm trixie
for suite in "$@"; do
    try_suite "$suite"
done
