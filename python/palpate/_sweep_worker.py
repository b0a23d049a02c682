"""The process of palpate.sweep(): it forks, so it has one thread. Prints a JSON object per line."""

import json
import sys

from . import _palpate
from ._errors import Error


def main():
    job = json.loads(sys.argv[1])
    last = None

    def told(done, of):
        nonlocal last
        if done != last:
            print(json.dumps({"done": done, "of": of}), flush=True)
            last = done
        return True

    try:
        _palpate.run_sweep(job["folder"], job["plan"], job["jobs"], job["retry"], job["any_build"], told)
    except Error as error:
        print(json.dumps({"error": str(error)}), flush=True)
        return 1
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
