# shellcheck shell=bash
# Sourced by tests that need programs of the system.

# packages NAME...: installs Debian packages; tests that run at the same time wait for each other.
packages() {
    if [ $# = 0 ]; then return; fi
    local as_root=''
    if [ "$(id -u)" != 0 ]; then as_root=sudo; fi
    (
        flock 9
        $as_root apt-get update -qq
        $as_root apt-get install -y -qq --no-install-recommends "$@"
    ) 9<"${BASH_SOURCE[0]}"
}
