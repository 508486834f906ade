"""Makes the materials of many files with the workers of a Dask cluster, each of which runs parts of a batch:

    python examples/batch_dask.py --parts 40 materials 'scans/*.bsdf' --no-metrics

The first argument is the folder for the outputs, which all workers share; the others are those of `gpbrdf-cli batch`.
Without `--scheduler` the cluster is one of this machine. Run again with as many parts, it goes on where it stopped.
Needs `pip install dask distributed`, and `gpbrdf-cli` on the path or in `--program`.
"""

import argparse
import json
import subprocess
import sys

from dask.distributed import Client, LocalCluster, as_completed


def make_part(program, part, parts, output, threads, arguments):
    """Runs one part of the batch. Returns its lines, one for each material, and what it says on standard error."""
    command = [program, "--quiet", "--threads", str(threads), "batch", *arguments]
    command += ["--output", output, "--part", f"{part}/{parts}"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    return [json.loads(line) for line in run.stdout.splitlines()], run.returncode, run.stderr


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scheduler", help="address of a running cluster, such as tcp://host:8786")
    parser.add_argument("--workers", type=int, default=2, help="workers of a cluster of this machine (default: 2)")
    parser.add_argument("--threads", type=int, default=1, help="threads of each part (default: 1)")
    parser.add_argument("--parts", type=int, default=8, help="parts of the batch (default: 8)")
    parser.add_argument("--program", default="gpbrdf-cli", help="the command line (default: gpbrdf-cli)")
    parser.add_argument("output", help="folder for the outputs, shared by all workers")
    parser.add_argument("arguments", nargs=argparse.REMAINDER, help="arguments of `gpbrdf-cli batch`")
    options = parser.parse_args()

    cluster = None
    if options.scheduler is None:
        cluster = LocalCluster(n_workers=options.workers, threads_per_worker=1, dashboard_address=None)
    failed = 0
    with Client(options.scheduler or cluster) as client:
        parts = [
            client.submit(
                make_part,
                options.program,
                part,
                options.parts,
                options.output,
                options.threads,
                options.arguments,
                pure=False,
            )
            for part in range(1, options.parts + 1)
        ]
        for future in as_completed(parts):
            lines, code, messages = future.result()
            for line in lines:
                print(json.dumps(line), flush=True)
            sys.stderr.write(messages)
            failed += code != 0
    if cluster is not None:
        cluster.close()
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
