#!/usr/bin/env bash
# Builds the wheel of the Python package, installs it into a fresh virtual environment, compares its type stubs with
# what it has, and runs its tests and its example: bash scripts/check-python.sh [--release]
# Needs Python 3.10 or newer with venv, and Rust.
set -euo pipefail
cd "$(dirname "$0")/.."

profile="${1:---profile=dev}"
scratch="$(mktemp -d)"
trap 'rm -rf "$scratch"' EXIT

python3 -m venv "$scratch/venv"
python="$scratch/venv/bin/python"
"$python" -m pip install --quiet maturin==1.16.0 mypy==2.4.1 pytest==9.2.0 matplotlib==3.11.2
"$python" -m maturin build --locked "$profile" -m crates/gpbrdf-python/Cargo.toml -i "$python" -o "$scratch/wheels"
"$python" -m pip install --quiet "$scratch"/wheels/*.whl
# Outside the project, so that the wheel is what is imported.
project="$PWD"
cd "$scratch"
# The library within the package, which the package hands on.
echo "gpbrdf.gpbrdf" >allowed
"$python" -m mypy.stubtest gpbrdf --allowlist allowed
"$python" -m pytest -q -p no:cacheprovider "$project/crates/gpbrdf-python/tests"
MPLBACKEND=Agg "$python" "$project/examples/python/plan_and_predict.py" "$scratch/plan_and_predict.png"
test -s "$scratch/plan_and_predict.png"
