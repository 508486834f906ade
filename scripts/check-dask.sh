#!/usr/bin/env bash
# Runs examples/batch_dask.py on a cluster of this machine, and examples/batch.slurm as Slurm would:
#
#   bash scripts/check-dask.sh [target/debug/gpbrdf-cli]
#
# Checks that both make the files that one run of the command makes, that a second run makes nothing again, and that a
# broken file is reported. Installs dask and distributed into a folder that is removed at the end.
set -euo pipefail
cd "$(dirname "$0")/.."
program="$(realpath "${1:-target/debug/gpbrdf-cli}")"
scratch="$(mktemp -d)"
trap 'rm -rf "$scratch"' EXIT

python3 -m venv "$scratch/venv"
"$scratch/venv/bin/pip" install --quiet dask==2026.8.0 distributed==2026.8.0
options=(--lattice 10x8x6 --no-metrics --write binary,model)
materials=(ward phong lambert cook-torrance red-plastic)
"$program" --quiet batch "${materials[@]}" "${options[@]}" -o "$scratch/one" >"$scratch/one.jsonl"

dask() {
  "$scratch/venv/bin/python" examples/batch_dask.py --program "$program" --parts 3 "$scratch/dask" "$@" \
    "${options[@]}"
}
dask "${materials[@]}" >"$scratch/dask.jsonl"
dask "${materials[@]}" >"$scratch/again.jsonl"
for part in 1 2; do
  SLURM_ARRAY_TASK_ID=$part SLURM_ARRAY_TASK_COUNT=2 SLURM_CPUS_PER_TASK=2 SLURM_MEM_PER_NODE=4096 \
    PATH="$(dirname "$program"):$PATH" bash examples/batch.slurm "$scratch/slurm" "${materials[@]}" "${options[@]}" \
    >>"$scratch/slurm.jsonl"
done
for folder in dask slurm; do
  diff -r --exclude='*.jsonl' "$scratch/one" "$scratch/$folder"
done
for lines in dask again slurm; do
  [ "$(wc -l <"$scratch/$lines.jsonl")" = "${#materials[@]}" ]
done
[ "$(cat "$scratch"/dask/batch-*.jsonl | wc -l)" = "${#materials[@]}" ]

echo "broken" >"$scratch/broken.csv"
if dask ward "$scratch/broken.csv" >"$scratch/broken.jsonl" 2>"$scratch/messages"; then
  echo "a broken file: expected exit code 1, found 0" >&2
  exit 1
fi
grep -q '"error":' "$scratch/broken.jsonl"
grep -q "^error: broken: " "$scratch/messages"
echo "Dask and Slurm make the same files as one run"
