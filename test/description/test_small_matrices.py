"""Small matrices: the bits and the refusals of numpy.linalg."""

import numpy as np
import pytest

from wam_description.small_matrices import inverse, largest_eigenvalue, solution, solutions


@pytest.mark.parametrize("n", [1, 3, 4, 7])
def test_inverse_and_solution_have_the_bits_of_numpy(n: int) -> None:
    random = np.random.default_rng(n)
    for _ in range(100):
        root, right = random.normal(size=(n, n)), random.normal(size=n)
        matrix = root @ root.T * 10.0 ** random.uniform(-6.0, 3.0)
        assert inverse(matrix).tobytes() == np.linalg.inv(matrix).tobytes()
        assert largest_eigenvalue(matrix) == np.linalg.eigvalsh(matrix)[-1]
        assert solution(matrix, right).tobytes() == np.linalg.solve(matrix, right).tobytes()
        matrices, sides = np.stack([matrix, root]), random.normal(size=(2, n))
        assert solutions(matrices, sides).tobytes() == np.linalg.solve(matrices, sides[:, :, None]).tobytes()


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")
def test_a_singular_matrix_is_refused_as_by_numpy() -> None:
    singular = np.outer([1.0, 2.0, 3.0], [1.0, 2.0, 3.0])
    singular[:, 0] = 0.0
    with pytest.raises(np.linalg.LinAlgError):
        inverse(singular)
    with pytest.raises(np.linalg.LinAlgError):
        solution(singular, np.ones(3))
    with pytest.raises(np.linalg.LinAlgError):
        solutions(np.stack([np.eye(3), singular]), np.ones((2, 3)))
