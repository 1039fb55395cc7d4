"""An entry of a ledger, to be changed."""

from execbook import claims

BASE = {
    "id": "c", "where": "Table 1", "source": "Table 1, row 2", "says": "something", "printed": 2.0, "unit": "m",
    "metric": "toy/01-line:x", "accept": {"rel": 0.1}, "verdict": "reproduced",
}  # fmt: skip


def make(**change):
    return claims.Claim.model_validate({k: v for k, v in (BASE | change).items() if v is not None})
