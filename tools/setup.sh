# shellcheck shell=bash
# Sourced by quickstart and check: what both need to say, to run and to install.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
top=$PWD
mkdir -p build

note() { printf '  note: %s\n' "$*"; }

fail() {
  printf '%s: %s\n' "${0##*/}" "$*" >&2
  exit 1
}

# step NAME COMMAND...: one line with the seconds it took; what it prints goes into a log
step() {
  local name=$1 log=$top/build/${0##*/}.log start=$SECONDS
  shift
  printf '%-44s ' "$name"
  if ! "$@" >"$log" 2>&1 </dev/null; then
    printf 'failed\n'
    tail -n 30 "$log" >&2
    return 1
  fi
  printf '%4d s\n' $((SECONDS - start))
}

# Two folders because Debian keeps these headers below /usr/include.
header_is_there() {
  printf '#if !__has_include(<%s>)\n#error missing\n#endif\n' "$1" |
    cc -E -I/usr/include/suitesparse -I/usr/include/hdf5/serial - >/dev/null 2>&1
}

# is_there KIND NAME, as in tools/packages. Asks for the thing and not for the package: it may have
# come in another way, and this works where there is no apt.
is_there() {
  case $1 in
    command) command -v "$2" >/dev/null ;;
    header) header_is_there "$2" ;;
    library) PATH=$PATH:/sbin:/usr/sbin ldconfig -p 2>/dev/null | grep -F "$2 " >/dev/null ;;
    file) compgen -G "$2" >/dev/null ;;
    module) python3 -c "import $2" 2>/dev/null ;;
  esac
}

# missing GROUPS...: the packages of these groups that are not there, one a line
missing() {
  local package group kind name
  while read -r package group kind name; do
    [[ $package != '#' && " $* " == *" $group "* ]] || continue
    is_there "$kind" "$name" || echo "$package"
  done <tools/packages
}

# apt_install PACKAGES...: those that this distribution has
apt_install() {
  local apt=(env DEBIAN_FRONTEND=noninteractive apt-get -q -o DPkg::Lock::Timeout=300) known=()
  if ((EUID != 0)); then apt=(sudo "${apt[@]}"); fi
  "${apt[@]}" update || true # one broken source among many; what counts is the next command
  for package in "$@"; do
    if apt-cache show "$package" >/dev/null 2>&1; then known+=("$package"); fi
  done
  "${apt[@]}" install -y --no-install-recommends "${known[@]}"
}

can_apt_install() {
  command -v apt-get >/dev/null || return 1
  ((EUID == 0)) && return
  command -v sudo >/dev/null || return 1
  [[ -t 0 ]] || sudo -n true 2>/dev/null # nobody is there to type a password
}

# packages GROUPS...: installs what is missing. Ends the script where the group `build` stays
# incomplete; without the others something is left out, which is said.
packages() {
  local absent needed
  mapfile -t absent < <(missing "$@")
  if ((${#absent[@]} == 0)); then return; fi
  if can_apt_install; then
    step "installing packages (${#absent[@]})" apt_install "${absent[@]}" || true
    mapfile -t absent < <(missing "$@")
  else
    note "packages cannot be installed here; the names below are those of Debian and Ubuntu"
  fi
  needed=$(missing build | xargs)
  [[ -z $needed ]] || fail "msim cannot be built without $needed"
  if ((${#absent[@]} > 0)); then note "continuing without ${absent[*]}"; fi
}
