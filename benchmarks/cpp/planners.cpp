// OMPL's planners with Line-R as their objective:
// planners PROBLEM PLANNER SEED SECONDS FIRST GROWTH [NAME=VALUE]...
//
// PLANNER is rrt-star, informed-rrt-star or bit-star; NAME=VALUE are OMPL's own parameters.
// The planner runs for SECONDS. It is looked at after FIRST seconds, and then each time the seconds
// have grown by the factor GROWTH. Prints one line of JSON: for each look the seconds, the length of
// the path as the planner believes it, and the path where it is a new one.
//
// This is best for OMPL: obstacles are tested exactly. Informed sampling draws from the ellipse on
// the plane, and the heuristic is the distance on the plane: no path is shorter than on the plane.
#include "surface.hpp"

#include <chrono>
#include <cstdio>
#include <ctime>
#include <exception>
#include <memory>

#include <ompl/base/MotionValidator.h>
#include <ompl/base/OptimizationObjective.h>
#include <ompl/base/PlannerTerminationCondition.h>
#include <ompl/base/ProblemDefinition.h>
#include <ompl/base/goals/GoalRegion.h>
#include <ompl/base/samplers/informed/PathLengthDirectInfSampler.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/geometric/PathGeometric.h>
#include <ompl/geometric/planners/informedtrees/BITstar.h>
#include <ompl/geometric/planners/rrt/InformedRRTstar.h>
#include <ompl/geometric/planners/rrt/RRTstar.h>
#include <ompl/util/Console.h>
#include <ompl/util/RandomNumbers.h>

namespace ob = ompl::base;
namespace og = ompl::geometric;

namespace {

const double *point(const ob::State *state) {
    return state->as<ob::RealVectorStateSpace::StateType>()->values;
}

template <class Surface>
class LineRObjective : public ob::OptimizationObjective {
  public:
    LineRObjective(const ob::SpaceInformationPtr &space, const Surface &surface, double panel)
        : ob::OptimizationObjective(space), surface_(surface), panel_(panel) {
        description_ = "Line-R";
        setCostToGoHeuristic(&ob::goalRegionCostToGo);
    }

    ob::Cost stateCost(const ob::State *) const override { return identityCost(); }

    ob::Cost motionCost(const ob::State *a, const ob::State *b) const override {
        const double *p = point(a), *q = point(b);
        return ob::Cost(edge_length(surface_, panel_, p[0], p[1], q[0], q[1]));
    }

    ob::Cost motionCostHeuristic(const ob::State *a, const ob::State *b) const override {
        const double *p = point(a), *q = point(b);
        return ob::Cost(std::hypot(q[0] - p[0], q[1] - p[1]));
    }

    ob::InformedSamplerPtr allocInformedStateSampler(const ob::ProblemDefinitionPtr &definition,
                                                     unsigned int most) const override {
        return std::make_shared<ob::PathLengthDirectInfSampler>(definition, most);
    }

  private:
    const Surface &surface_;
    double panel_;
};

class DiscValidator : public ob::MotionValidator {
  public:
    DiscValidator(const ob::SpaceInformationPtr &space, const Problem &problem)
        : ob::MotionValidator(space), problem_(problem) {}

    bool checkMotion(const ob::State *a, const ob::State *b) const override {
        const double *p = point(a), *q = point(b);
        return problem_.is_free(p[0], p[1], q[0], q[1]);
    }

    bool checkMotion(const ob::State *a, const ob::State *b,
                     std::pair<ob::State *, double> &last) const override {
        if (checkMotion(a, b)) return true;
        if (last.first != nullptr) si_->copyState(last.first, a);
        last.second = 0.0;
        return false;
    }

  private:
    const Problem &problem_;
};

ob::SpaceInformationPtr make_space(const Problem &problem) {
    auto plane = std::make_shared<ob::RealVectorStateSpace>(2);
    ob::RealVectorBounds bounds(2);
    for (unsigned int k = 0; k < 2; ++k) {
        bounds.setLow(k, problem.low[k]);
        bounds.setHigh(k, problem.high[k]);
    }
    plane->setBounds(bounds);
    auto space = std::make_shared<ob::SpaceInformation>(plane);
    space->setStateValidityChecker([&problem](const ob::State *state) {
        const double *p = point(state);
        return problem.is_free(p[0], p[1], p[0], p[1]);
    });
    space->setMotionValidator(std::make_shared<DiscValidator>(space, problem));
    space->setup();
    return space;
}

ob::ProblemDefinitionPtr make_definition(const ob::SpaceInformationPtr &space,
                                         const Problem &problem) {
    auto definition = std::make_shared<ob::ProblemDefinition>(space);
    ob::ScopedState<ob::RealVectorStateSpace> start(space), goal(space);
    for (unsigned int k = 0; k < 2; ++k) {
        start[k] = problem.start[k];
        goal[k] = problem.goal[k];
    }
    definition->setStartAndGoalStates(start, goal);
    std::visit(
        [&](const auto &surface) {
            using Surface = std::decay_t<decltype(surface)>;
            definition->setOptimizationObjective(
                std::make_shared<LineRObjective<Surface>>(space, surface, problem.panel));
        },
        problem.surface);
    return definition;
}

ob::PlannerPtr make_planner(const std::string &name, const ob::SpaceInformationPtr &space) {
    if (name == "rrt-star") return std::make_shared<og::RRTstar>(space);
    if (name == "informed-rrt-star") return std::make_shared<og::InformedRRTstar>(space);
    if (name == "bit-star") return std::make_shared<og::BITstar>(space);
    throw std::runtime_error("planner " + name + " is not known");
}

void set_parameter(ob::Planner &planner, const std::string &text) {
    const std::size_t sign = text.find('=');
    if (sign == std::string::npos ||
        !planner.params().setParam(text.substr(0, sign), text.substr(sign + 1)))
        throw std::runtime_error(planner.getName() + " does not take " + text);
}

struct Look {
    double wall, processor, cost;
    std::vector<double> path;  // x, y, x, y, ...; empty where it is the same as at the look before
};

class Run {
  public:
    Run(ob::ProblemDefinitionPtr definition, ob::PlannerPtr planner)
        : definition_(std::move(definition)), planner_(std::move(planner)) {
        planner_->setProblemDefinition(definition_);
    }

    std::vector<Look> looks(double seconds, double first, double growth) {
        began_ = std::chrono::steady_clock::now();
        used_ = std::clock();
        planner_->setup();
        std::vector<Look> found;
        for (double next = std::min(first, seconds);; next = std::min(next * growth, seconds)) {
            planner_->solve(ob::PlannerTerminationCondition([&] { return wall() >= next; }));
            found.push_back(look());
            if (next >= seconds) return found;
        }
    }

  private:
    double wall() const {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - began_).count();
    }

    Look look() {
        const double processor = static_cast<double>(std::clock() - used_) / CLOCKS_PER_SEC;
        Look found{wall(), processor, -1.0, {}};
        if (!definition_->hasExactSolution()) return found;
        const auto path =
            std::static_pointer_cast<og::PathGeometric>(definition_->getSolutionPath());
        found.cost = path->cost(definition_->getOptimizationObjective()).value();
        if (found.cost == last_cost_) return found;
        last_cost_ = found.cost;
        for (const ob::State *state : path->getStates())
            found.path.insert(found.path.end(), {point(state)[0], point(state)[1]});
        return found;
    }

    ob::ProblemDefinitionPtr definition_;
    ob::PlannerPtr planner_;
    std::chrono::steady_clock::time_point began_;
    std::clock_t used_ = 0;
    double last_cost_ = -1.0;
};

void print(const std::vector<Look> &looks) {
    std::printf("{\"looks\": [");
    for (std::size_t k = 0; k < looks.size(); ++k) {
        const Look &look = looks[k];
        std::printf("%s{\"wall\": %.6f, \"processor\": %.6f, ", k > 0 ? ", " : "", look.wall,
                    look.processor);
        if (look.cost < 0.0)
            std::printf("\"cost\": null, \"path\": [");
        else
            std::printf("\"cost\": %.17g, \"path\": [", look.cost);
        for (std::size_t m = 0; m < look.path.size(); ++m)
            std::printf("%s%.17g", m > 0 ? ", " : "", look.path[m]);
        std::printf("]}");
    }
    std::printf("]}\n");
}

void run(int argc, char **argv) {
    ompl::msg::noOutputHandler();
    ompl::RNG::setSeed(std::stoul(argv[3]));
    const Problem problem(argv[1]);
    const ob::SpaceInformationPtr space = make_space(problem);
    const ob::PlannerPtr planner = make_planner(argv[2], space);
    for (int k = 7; k < argc; ++k) set_parameter(*planner, argv[k]);
    Run planned(make_definition(space, problem), planner);
    print(planned.looks(std::stod(argv[4]), std::stod(argv[5]), std::stod(argv[6])));
}

}  // namespace

int main(int argc, char **argv) {
    if (argc < 7) {
        std::fprintf(stderr,
                     "usage: planners PROBLEM PLANNER SEED SECONDS FIRST GROWTH [NAME=VALUE]...\n");
        return 2;
    }
    try {
        run(argc, argv);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "planners: %s\n", error.what());
        return 1;
    }
    return 0;
}
