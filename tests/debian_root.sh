# Bare Debian roots for tests that install what ./dev builds: sourced by scripts that need root, debootstrap and
# a network, and end with 77 (skipped) otherwise. BORESIGHT_TEST_NETWORK=1 in the environment says that there is
# one. BORESIGHT_MIRROR: a Debian mirror, by default that of apt here. BORESIGHT_ROOTS: a folder where bare roots
# are kept for the next time.

skip() {
    printf '%s\n' "skipped: $*"
    exit 77
}

[ -n "${BORESIGHT_TEST_NETWORK:-}" ] || skip "needs a network: set BORESIGHT_TEST_NETWORK=1"
[ "$(id -u)" -eq 0 ] || skip "needs root"
command -v debootstrap >/dev/null || skip "needs debootstrap"
unshare --mount true 2>/dev/null || skip "may not mount file systems"

mirror=${BORESIGHT_MIRROR:-$(apt-get indextargets --format '$(CODENAME) $(REPO_URI)' \
    'Created-By: Packages' | awk '$1 !~ /-/ { print $2; exit }')}
[ -n "$mirror" ] || skip "apt has no Debian mirror: set BORESIGHT_MIRROR"

work=$(mktemp -d "${TMPDIR:-/var/tmp}/bare_root.XXXXXX")
trap 'rm -rf --one-file-system "$work"' EXIT INT TERM

# make_root SUITE PACKAGES: a new bare root in $root, with PACKAGES (separated by commas) of Debian.
make_root() {
    kept=${BORESIGHT_ROOTS:+$BORESIGHT_ROOTS/$1-$2}
    root=$work/$1
    if [ -n "$kept" ] && [ -f "$kept.tar" ]; then
        mkdir "$root"
        tar -C "$root" -xf "$kept.tar"
        return
    fi
    debootstrap --variant=minbase --include="$2" "$1" "$root" \
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
