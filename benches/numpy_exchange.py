"""The peer of the choice of poses: the same exchange for the largest determinant, in vectorised NumPy.

Kept up by changes of rank m, m rows a pose: the inverse of M^t M, and A_j = J_j V J_j^T of all candidates.
"""

import numpy as np

RIDGE, BETTER, RENEWAL = 1e-7, 1e-9, 200


class Exchange:
    """A greedy start, then the best candidate comes in and the pose missed least goes out."""

    def __init__(self, jacobian):
        self.jacobian = jacobian  # (N, m, P), scaled
        self.poses, self.rows, width = jacobian.shape
        size = np.einsum("nip,nip->", jacobian, jacobian) / (self.poses * width)
        self.ridge = RIDGE * size * np.eye(width)
        self.chosen, self.free, self.changes = [], np.ones(self.poses, dtype=bool), 0
        self.renew()

    def renew(self):
        rows = self.jacobian[self.chosen].reshape(-1, self.jacobian.shape[2])
        self.inverse = np.linalg.inv(self.ridge + rows.T @ rows)
        self.inner = self.jacobian @ self.inverse @ self.jacobian.transpose(0, 2, 1)
        self.changes = 0

    def change(self, pose, sign):
        block = np.eye(self.rows) + sign * self.inner[pose]
        part = np.linalg.solve(np.linalg.cholesky(block), self.jacobian[pose] @ self.inverse)
        self.inverse -= sign * part.T @ part
        moved = self.jacobian @ part.T
        self.inner -= sign * moved @ moved.transpose(0, 2, 1)
        self.changes += 1

    def add(self):
        gains = np.where(self.free, np.linalg.det(np.eye(self.rows) + self.inner), 0.0)
        pose = int(np.argmax(gains))
        self.change(pose, 1.0)
        self.chosen.append(pose)
        self.free[pose] = False
        return gains[pose]

    def choose(self, count, passes):
        while len(self.chosen) < count:
            self.add()
        for _ in range(passes * count):
            if self.changes > RENEWAL:
                self.renew()
            gain = self.add()
            losses = np.linalg.det(np.eye(self.rows) - self.inner[self.chosen])
            place = int(np.argmax(losses))
            worth = place != len(losses) - 1 and gain * losses[place] > 1.0 + BETTER
            pose = self.chosen.pop(place if worth else -1)
            self.change(pose, -1.0)
            self.free[pose] = True
            if not worth:
                break
        return sorted(self.chosen)
