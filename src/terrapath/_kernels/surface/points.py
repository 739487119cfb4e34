"""Values, jets, costs and the metric at many points; results are filled in."""

from ..compiler import kernel
from .surfaces import cell_cost_at, jet_at, log_cost_at, metric_at, put_jet, spot_at, value_at


@kernel
def fill_values(surface, points, values):
    """Values (m, layers)."""
    for m in range(points.shape[0]):
        spot = spot_at(surface, points[m, 0], points[m, 1])
        for layer in range(surface.weights.shape[0]):
            values[m, layer] = value_at(surface, layer, spot)


@kernel
def fill_jets(surface, points, jets):
    """Jets (m, layers, 6)."""
    for m in range(points.shape[0]):
        for layer in range(surface.weights.shape[0]):
            put_jet(jets[m, layer], jet_at(surface, layer, points[m, 0], points[m, 1]))


@kernel
def fill_log_costs(surface, points, jets):
    """Jets (m, 6) of the logarithm of the smooth cost."""
    for m in range(points.shape[0]):
        put_jet(jets[m], log_cost_at(surface, points[m, 0], points[m, 1]))


@kernel
def fill_cell_costs(surface, points, costs):
    """The costs (m,) of the cells at points."""
    for m in range(points.shape[0]):
        costs[m] = cell_cost_at(surface, points[m, 0], points[m, 1])


@kernel
def fill_metric(surface, points, tensors):
    """Metric tensors (m, 2, 2)."""
    for m in range(points.shape[0]):
        h = metric_at(surface, points[m, 0], points[m, 1])
        tensors[m, 0, 0] = h.h11
        tensors[m, 0, 1] = h.h12
        tensors[m, 1, 0] = h.h12
        tensors[m, 1, 1] = h.h22
