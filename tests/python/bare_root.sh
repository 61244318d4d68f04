#!/bin/sh
# Installs the wheel that ./dev wheel built in bare Debian roots, which have their own Python and
# nothing else, and runs tests/python/bare_root.py there: the closed loop without an OpenCL device,
# and with images by PoCL, of the extra boresight[pocl] and of Debian.
#
#     bare_root.sh [SUITE...]     Debian releases; default: bookworm trixie
#
# What it needs, and the environment: tests/debian_root.sh. pip obeys the PIP_ variables.
set -eu

sources=$(CDPATH='' cd -- "$(dirname -- "$0")/../.." && pwd -P)
. "$sources/tests/debian_root.sh"

wheel=$(ls -t "$sources"/dist/boresight-*.whl 2>/dev/null | head -n 1)
[ -n "$wheel" ] || skip "no wheel in dist: run ./dev wheel"

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
    make_root "$suite" python3,python3-venv,ca-certificates
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
