#!/bin/sh
# Creates the virtual environment $VENV and installs the package.
# OpenGL libraries come from apt when this runs as root; otherwise it says what to run.
set -eu

if ! "$PYTHON" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 15))' 2>/dev/null; then
    echo "error: '$PYTHON' is not Python 3.11 to 3.14; run: make PYTHON=/path/to/python3.11" >&2
    exit 1
fi

packages=""
if command -v dpkg >/dev/null; then
    for package in libegl1 libgl1-mesa-dri libopengl0; do
        dpkg -s "$package" >/dev/null 2>&1 || packages="$packages $package"
    done
fi
command -v c++ >/dev/null || command -v g++ >/dev/null || packages="$packages g++"
"$PYTHON" -c 'import ensurepip, venv' 2>/dev/null || packages="$packages python3-venv"
if [ -n "$packages" ]; then
    command="apt-get update && apt-get install -y$packages"
    if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
        sh -c "$command"
    else
        echo "error: missing system packages; run: sudo sh -c '$command'" >&2
        exit 1
    fi
fi

"$PYTHON" -m venv "$VENV"
"$VENV/bin/python" -m pip install --quiet --upgrade pip
"$VENV/bin/python" -m pip install --quiet --editable .
# Python 3.13 and 3.14 have no wheels of labmaze, which only the locomotion tasks of dm_control need.
if "$VENV/bin/python" -c 'import sys; sys.exit(sys.version_info < (3, 13))'; then
    "$VENV/bin/python" -m pip install --quiet --no-deps 'dm-control>=1.0.50,<1.1'
fi
