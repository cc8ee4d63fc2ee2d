// SPDX-License-Identifier: GPL-3.0-or-later
// Prints the tables of docs/flesh-answers.md: flesh against the numbers of its theory.
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>
#include <fmt/format.h>

#include "octree/base/segment.h"
#include "solver/flesh/bone_points.h"
#include "solver/flesh/bone_tube.h"
#include "solver/flesh/flesh.h"
#include "solver/flesh/flesh_forces.h"
#include "solver/flesh/part_points.h"
#include "tests/support/flesh.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"
#include "tests/support/source_rules.h"

namespace
{

using namespace cellwarp::core;
using namespace cellwarp::core::support;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Sparse = Eigen::SparseMatrix<double>;

constexpr std::array<double, 4> kPoisson = {0.0, 0.3, 0.45, 0.499};

void title(const std::string& text, const std::string& columns)
{
    fmt::print("\n## {}\n\n| {} |\n|", text, columns);
    for (std::size_t k = 0;
         k <= std::size_t(std::count(columns.begin(), columns.end(), '|')); ++k)
        fmt::print("---|");
    fmt::print("\n");
}

void row(const std::string& what, double exact, double ours)
{
    fmt::print("| {} | {:.8g} | {:.8g} | {:.1e} |\n", what, exact, ours,
               exact != 0.0 ? ours / exact - 1.0 : ours);
}

bool is_held(const Vector3d& x)
{
    return x.x() < 1e-9;
}

/// Stiffness and mass over the nodes that are not held.
struct System
{
    Sparse K, M;
    std::vector<int> number; ///< of a node, or -1

    /// \p of_cell: of equal cells, instead of the program's.
    System(const Lattice& lattice, const FleshMaterial& material, bool has_modes,
           const std::function<bool(const Vector3d&)>& held,
           const CellMatrices* of_cell = nullptr)
        : number(lattice.places.size(), -1)
    {
        int count = 0;
        for (std::size_t n = 0; n < number.size(); ++n)
            if (!held(lattice.places[n]))
                number[n] = count++;
        std::vector<Eigen::Triplet<double>> stiff, heavy;
        for (const LatticePart& part : lattice.parts)
        {
            const PartPoints points = points_of(lattice, part);
            const PartMatrix k =
                of_cell ? of_cell->stiffness : stiffness_of(points, material, has_modes);
            const Eigen::Matrix<double, 8, 8> m =
                of_cell ? of_cell->mass : mass_of(points, material.density);
            const CornerNodes& nodes = lattice.cells[idx(part.cell)];
            for (int a = 0; a < 8; ++a)
                for (int b = 0; b < 8; ++b)
                {
                    const int i = number[idx(nodes[idx(a)])],
                              j = number[idx(nodes[idx(b)])];
                    if (i < 0 || j < 0)
                        continue;
                    for (int c = 0; c < 3; ++c)
                    {
                        heavy.emplace_back(3 * i + c, 3 * j + c, m(a, b));
                        for (int d = 0; d < 3; ++d)
                            stiff.emplace_back(3 * i + c, 3 * j + d,
                                               k(3 * a + c, 3 * b + d));
                    }
                }
        }
        K.resize(3 * count, 3 * count);
        K.setFromTriplets(stiff.begin(), stiff.end());
        M.resize(3 * count, 3 * count);
        M.setFromTriplets(heavy.begin(), heavy.end());
    }
    VectorXd reduced(const VectorXd& all) const
    {
        VectorXd out(K.rows());
        for (std::size_t n = 0; n < number.size(); ++n)
            if (number[n] >= 0)
                out.segment<3>(3 * number[n]) = all.segment<3>(Eigen::Index(3 * n));
        return out;
    }
    /// The lowest frequency, by inverse iteration.
    double lowest() const
    {
        const Eigen::SimplicialLDLT<Sparse> factor(K);
        VectorXd x = VectorXd::Random(K.rows());
        double value = 0.0;
        for (int k = 0; k < 60; ++k)
        {
            x = factor.solve(M * x);
            x /= std::sqrt(x.dot(M * x));
            value = x.dot(K * x);
        }
        return std::sqrt(value);
    }
};

void cantilever()
{
    // Tips and lowest frequencies: [known-answers 8] and "incompatible" of
    // theory-skeleton 12.
    constexpr double kPlain[3][4] = {{2680.000, 2591.190, 2071.670, 948.272},
                                     {3573.333, 3503.158, 3056.976, 1705.071},
                                     {3900.808, 3859.437, 3640.888, 2369.481}},
                     kModes[3][4] = {{4010.000, 3972.639, 3880.111, 3372.636},
                                     {4017.500, 3977.258, 3891.963, 3661.574},
                                     {4022.177, 3992.435, 3937.183, 3875.030}};
    constexpr double kPlainOmega[3][2] = {
        {.012351, .012573}, {.010702, .010825}, {.010242, .010309}};
    constexpr double kModesOmega[2] = {.010104, .010163};
    title("Cantilever 10 x 1 x 1, unit shear at its end: tip, lowest frequency",
          "cells, Poisson | known | ours | difference");
    for (const bool has_modes : {false, true})
        for (int level = 0; level < 3; ++level)
        {
            const Lattice lattice = bar_lattice(1 << level);
            const VectorXd load = load_on_end(lattice, 10.0, {0, 0, 1});
            for (std::size_t k = 0; k < 4; ++k)
            {
                const System system(lattice, {1.0, kPoisson[k], 1.0}, has_modes, is_held);
                const VectorXd b = system.reduced(load);
                const double tip =
                    b.dot(Eigen::SimplicialLDLT<Sparse>(system.K).solve(b));
                const std::string name =
                    fmt::format("{} {} long, {}", has_modes ? "with modes," : "plain,",
                                10 << level, kPoisson[k]);
                row(name, (has_modes ? kModes : kPlain)[level][k], tip);
                if (k < 2 && !has_modes)
                    row(name + ", frequency", kPlainOmega[level][k], system.lowest());
                if (k < 2 && has_modes && level == 0)
                    row(name + ", frequency", kModesOmega[k], system.lowest());
            }
        }
}

/// The source's rule, which the program does not use.
void cantilever_of_tetrahedra()
{
    constexpr double kWhole[3][4] = {{1793.333, 1632.150, 856.119, 56.381},
                                     {3065.714, 2910.612, 2021.014, 130.941},
                                     {3731.958, 3651.814, 3169.868, 401.618}},
                     kHalved[2][4] = {{2384.444, 2251.793, 1486.088, 112.527},
                                      {3431.200, 3331.812, 2695.667, 330.138}};
    title("The same by the source's tetrahedra: 24 a cell, or 192",
          "cells, Poisson | known | ours | difference");
    for (const int halvings : {0, 1})
        for (int level = 0; level < 3 - halvings; ++level)
        {
            const Lattice lattice = bar_lattice(1 << level);
            const VectorXd load = load_on_end(lattice, 10.0, {0, 0, 1});
            for (std::size_t k = 0; k < 4; ++k)
            {
                const FleshMaterial material{1.0, kPoisson[k], 1.0};
                const CellMatrices cell = tetrahedral(lattice, 0, material, halvings);
                const System system(lattice, material, false, is_held, &cell);
                const VectorXd b = system.reduced(load);
                row(fmt::format("{} tetrahedra, {} long, {}", halvings ? 192 : 24,
                                10 << level, kPoisson[k]),
                    (halvings ? kHalved : kWhole)[level][k],
                    b.dot(Eigen::SimplicialLDLT<Sparse>(system.K).solve(b)));
            }
        }
}

void thin_beam()
{
    title("Beam of MacNeal and Harder, 6 bricks: share of the theory's deflection",
          "direction | known | ours | difference");
    const Lattice lattice = grid_lattice({{{0, 1, 2, 3, 4, 5, 6}, {0, 0.2}, {0, 0.1}}});
    const std::array<double, 3> theory = {3e-5, 0.1081, 0.4321};
    const std::array<double, 3> known = {.9876, .9782, .9729};
    for (int axis = 0; axis < 3; ++axis)
    {
        const System system(lattice, {1e7, 0.3, 1.0}, true, is_held);
        const VectorXd b =
            system.reduced(load_on_end(lattice, 6.0, Vector3d::Unit(axis)));
        row(axis == 0   ? "along"
            : axis == 1 ? "in its plane"
                        : "out of its plane",
            known[idx(axis)],
            b.dot(Eigen::SimplicialLDLT<Sparse>(system.K).solve(b)) / theory[idx(axis)]);
    }
}

void free_cube()
{
    title("Free cube, frequencies times edge sqrt(density / shear), 8 cells across",
          "Poisson, mode | known (Ritz) | ours | difference");
    constexpr std::array<std::pair<double, std::array<double, 6>>, 3> kKnown = {
        {{0.25, {2.8559, 2.8559, 3.8322, 3.8322, 3.8322, 3.9073}},
         {0.3, {2.8561, 2.8561, 3.8460, 3.8460, 3.8460, 3.9113}},
         {0.45, {2.8566, 2.8566, 3.8796, 3.8796, 3.8796, 3.9207}}}};
    const Lattice lattice = bar_lattice(8, 1);
    for (const auto& [poisson, known] : kKnown)
    {
        const FleshMaterial material{1.0, poisson, 1.0};
        const System system(lattice, material, true,
                            [](const Vector3d&) { return false; });
        const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> modes(
            MatrixXd(system.K), MatrixXd(system.M), Eigen::EigenvaluesOnly);
        for (std::size_t k = 0; k < known.size(); k += k == 0 ? 2 : 3)
            row(fmt::format("{}, mode {}", poisson, k + 1), known[k],
                std::sqrt(modes.eigenvalues()[Eigen::Index(6 + k)] / material.shear()));
    }
}

Motion about(const Vector3d& axis, double angle, const Vector3d& centre)
{
    Motion T{rotation_about(axis, angle), Vector3d::Zero()};
    T.t = centre - T.R * centre;
    return T;
}

/// A shape in a lattice with bones, its lengths those of the shape.
Flesh flesh_of(const Built& body, double unit, const std::vector<BoneLine>& lines,
               double radius, double chi, const FleshMaterial& material,
               const FleshSettings& settings)
{
    Lattice lattice = octree_lattice(body.octree, body.cells, unit);
    const auto holds = [&](int cell, const Vector3d& x)
    { return piece_at(body.material.grid, body.pieces, x / unit) == cell; };
    std::vector<TubeBone> bones;
    for (const BoneLine& line : lines)
        bones.push_back({line, radius});
    const std::vector<FleshMaterial> materials = {material};
    std::vector<TubePart> tubes;
    if (chi > 0.0)
        tubes =
            tube_parts(lattice, materials, bones,
                       points_in_tubes(body.material.grid, body.pieces, lattice, unit,
                                       voxels_in_tubes(body.material.grid, unit, bones)),
                       chi);
    std::vector<HeldPoint> points = points_on_bones(lattice, lines, holds);
    return Flesh(std::move(lattice), materials, std::move(points), std::move(tubes),
                 settings);
}

/// 8 x 2 x 2 in cubes of 0.5 or a whole share of it, two bones that meet in its middle.
Flesh joint(const FleshSettings& settings, const FleshMaterial& material, int share = 1)
{
    const Built body = bar(16 * share, 4 * share, 4 * share);
    Lattice lattice = octree_lattice(body.octree, body.cells, 0.5 / share);
    const std::vector<FleshMaterial> materials = {material};
    const std::vector<TubeBone> bones = {{{{0, 1, 1}, {4, 1, 1}, 0}, 0.5},
                                         {{{4, 1, 1}, {8, 1, 1}, 1}, 0.5}};
    std::vector<TubePart> tubes =
        tube_parts(lattice, materials, bones, points_in_tubes(lattice, bones), 10.0);
    std::vector<HeldPoint> points =
        points_on_bones(lattice, std::vector<BoneLine>{bones[0].line, bones[1].line},
                        [](int, const Vector3d&) { return true; });
    std::vector<FleshRegionShares> regions;
    if (settings.law == FleshLaw::Regions)
    {
        std::vector<std::vector<double>> distances(2);
        for (const Vector3d& x : lattice.places)
            for (std::size_t b = 0; b < 2; ++b)
            {
                const BoneLine& line = bones[b].line;
                const double t = nearest_share(line.from, line.to, x);
                distances[b].push_back(
                    (line.from + t * (line.to - line.from) - x).norm());
            }
        regions = shares_by_distance(lattice, distances, std::vector<int>{0, 1}, 1.0);
    }
    return Flesh(std::move(lattice), materials, std::move(points), std::move(tubes),
                 settings, std::move(regions));
}

/// The bar of joint() whose second bone turns by 90 degrees in half a second, and half a
/// second later.
FleshState turned_in_time(Flesh& flesh, double dt)
{
    FleshState state = flesh.rest();
    const int steps = static_cast<int>(std::lround(1.0 / dt));
    for (int step = 1; step <= steps; ++step)
        flesh.step(state, dt,
                   std::vector<Motion>{
                       {},
                       about(Vector3d::UnitZ(),
                             std::min(1.0, 2.0 * step * dt) * std::numbers::pi / 2.0,
                             {4, 1, 1})});
    return state;
}

/// The cantilever under a small load, which all laws are to bear alike.
void cantilever_by_law()
{
    title("The cantilever under 1e-7 of that load, by law",
          "cells thick, Poisson | with modes, 40 long | linear | cells | stvk | "
          "neo-hookean");
    constexpr std::array<double, 4> kKnown = {4022.177, 3992.435, 3937.183, 3875.03};
    for (const int across : {1, 2})
        for (std::size_t k = 0; k < kPoisson.size(); ++k)
        {
            fmt::print("| {}, {} | {:.0f} |", across, kPoisson[k], kKnown[k]);
            for (const FleshLaw law : {FleshLaw::Linear, FleshLaw::Cells,
                                       FleshLaw::StVenantKirchhoff, FleshLaw::NeoHookean})
            {
                FleshSettings settings;
                settings.law = law;
                settings.tolerance = 1e-10;
                const Lattice lattice = bar_lattice(across);
                const VectorXd load = load_on_end(lattice, 10.0, {0, 0, 1});
                Flesh flesh(lattice, {{1.0, kPoisson[k], 1.0}},
                            held_nodes(lattice, is_held), {}, settings);
                flesh.load(1e-7 * load);
                FleshState state = flesh.rest();
                flesh.settle(state, std::vector<Motion>(1));
                fmt::print(" {:.0f} |", 1e7 * load.dot(state.u));
            }
            fmt::print("\n");
        }
}

void laws_in_time()
{
    fmt::print(
        "\n## A joint turns by 90° in half a second: where the flesh is half a "
        "second later\n\nDistances of the nodes from those of `neo-hookean` in cells "
        "half as large, three rounds of Newton's method in each step of 1/240 s; of "
        "the bar's length. E = 3e6 Pa, 1 m a unit, cells of 0.5 m in a bar of 8 x 2 x "
        "2.\n\n| law, step | largest | RMS |\n| --- | ---: | ---: |\n");
    const auto settings = [](FleshLaw law, int newton)
    {
        FleshSettings out;
        out.law = law;
        out.newton = newton;
        out.alpha = 2.0;
        out.gravity = {0, -9.81, 0};
        out.tolerance = 1e-5;
        return out;
    };
    const FleshMaterial material = {3e6, 0.4, 1000.0};
    Flesh fine = joint(settings(FleshLaw::NeoHookean, 3), material, 2);
    const FleshState known = turned_in_time(fine, 1.0 / 240.0);
    std::map<std::array<double, 3>, std::size_t> fine_nodes;
    for (std::size_t n = 0; n < fine.lattice().places.size(); ++n)
    {
        const Vector3d& x = fine.lattice().places[n];
        fine_nodes[{x.x(), x.y(), x.z()}] = n;
    }
    struct Way
    {
        const char* name;
        FleshLaw law;
        int newton;
    };
    for (const auto& [name, law, newton] :
         {Way{"neo-hookean", FleshLaw::NeoHookean, 1},
          Way{"stvk", FleshLaw::StVenantKirchhoff, 1}, Way{"cells", FleshLaw::Cells, 1},
          Way{"regions", FleshLaw::Regions, 1}, Way{"linear", FleshLaw::Linear, 1}})
        for (const int rate : {120, 480})
        {
            Flesh flesh = joint(settings(law, newton), material);
            const FleshState state = turned_in_time(flesh, 1.0 / rate);
            double largest = 0.0, sum = 0.0;
            const std::size_t nodes = flesh.lattice().places.size();
            for (std::size_t n = 0; n < nodes; ++n)
            {
                const Vector3d& x = flesh.lattice().places[n];
                const std::size_t same = fine_nodes.at({x.x(), x.y(), x.z()});
                const double away = (state.u.segment<3>(Eigen::Index(3 * n)) -
                                     known.u.segment<3>(Eigen::Index(3 * same)))
                                        .norm() /
                                    8.0;
                largest = std::max(largest, away);
                sum += away * away;
            }
            fmt::print("| {}, 1/{} s | {:.4f} | {:.4f} |\n", name, rate, largest,
                       std::sqrt(sum / double(nodes)));
        }
}

void joints()
{
    title("A joint bends: volume over rest", "law, angle | known | ours | difference");
    struct Law
    {
        FleshLaw law;
        const char* name;
        double known[4];
    };
    for (const auto& [law, name, known] :
         {Law{FleshLaw::Linear, "linear", {1.097, 1.292, 1.336, 1.024}},
          Law{FleshLaw::Regions, "regions", {1.018, 1.047, 1.025, 0.912}},
          Law{FleshLaw::Cells, "cells", {0.995, 0.981, 0.980, 0.972}},
          Law{FleshLaw::StVenantKirchhoff, "stvk", {0.993, 0.962, 0.922, 0.903}},
          Law{FleshLaw::NeoHookean, "neo-hookean", {0.997, 0.988, 0.973, 0.981}}})
    {
        FleshSettings settings;
        settings.law = law;
        settings.tolerance = 1e-7;
        Flesh flesh = joint(settings, {1.0, 0.4, 1.0});
        FleshState state = flesh.rest();
        for (int step = 0; step < 4; ++step)
        {
            for (int part = 1; part <= 6; ++part)
                flesh.settle(state, std::vector<Motion>{{},
                                                        about(Vector3d::UnitZ(),
                                                              (step + part / 6.0) *
                                                                  std::numbers::pi / 6.0,
                                                              {4, 1, 1})});
            // The points' own determinants, as the table has them.
            double volume = 0.0;
            const Lattice& lattice = flesh.lattice();
            for (const LatticePart& part : lattice.parts)
            {
                const PartPoints points = points_of(lattice, part);
                for (int k = 0; k < 8; ++k)
                {
                    Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
                    const Eigen::Matrix<double, 3, 8> g = points.slopes(k);
                    for (int a = 0; a < 8; ++a)
                        F += state.u.segment<3>(3 *
                                                lattice.cells[idx(part.cell)][idx(a)]) *
                             g.col(a).transpose();
                    volume += points.weight[idx(k)] * F.determinant();
                }
            }
            row(fmt::format("{}, {}°", name, 30 * (step + 1)), known[step],
                volume / 32.0);
        }
    }
}

void patch_test()
{
    title("Even strain over cells of two sizes: largest force that is left inside, of "
          "the largest at the border",
          "known | ours");
    const Built body = built_mixed(box_shape({0, 0, 0}, {4, 2, 2}), 4, 1, 3);
    const Flesh flesh =
        flesh_of(body, 1.0, {}, 0.25, 0.0, {1.0, 0.4, 1.0}, FleshSettings());
    const MatrixXd K = reduced(flesh, 0, 1, 0);
    const Eigen::Matrix3d G{{0.3, -0.2, 0.1}, {0.5, 0.2, -0.4}, {0.1, 0.3, -0.1}};
    Eigen::VectorXd u(K.rows());
    const std::vector<int>& free = flesh.nodes().free;
    const auto place = [&](std::size_t k)
    { return flesh.lattice().places[idx(free[k])]; };
    for (std::size_t k = 0; k < free.size(); ++k)
        u.segment<3>(Eigen::Index(3 * k)) = G * place(k);
    const Eigen::VectorXd f = K * u;
    double inside = 0.0;
    for (std::size_t k = 0; k < free.size(); ++k)
        if ((place(k).array() > 1e-9).all() &&
            ((Eigen::Vector3d(4, 2, 2) - place(k)).array() > 1e-9).all())
            inside = std::max(inside, f.segment<3>(Eigen::Index(3 * k)).norm());
    fmt::print("| 0 | {:.1e} |\n", inside / f.cwiseAbs().maxCoeff());
}

void rigid_modes()
{
    title("Motions that cost nothing", "what is held | known | ours");
    const Built body = built_mixed(l_prism(), 7, 1, 3);
    const auto count = [&](const std::vector<BoneLine>& bones, double chi)
    {
        const Flesh flesh =
            flesh_of(body, 1.0, bones, 0.25, chi, {1.0, 0.4, 1.0}, FleshSettings());
        return count_zero(Eigen::SelfAdjointEigenSolver<MatrixXd>(reduced(flesh, 0, 1, 1),
                                                                  Eigen::EigenvaluesOnly)
                              .eigenvalues());
    };
    const BoneLine bone{{0.3, 0.4, 0.6}, {3.6, 0.5, 0.3}, 0},
        other{{0.3, 0.4, 0.6}, {0.6, 1.7, 0.5}, 0};
    const auto show = [](const char* what, int known, int ours)
    { fmt::print("| {} | {} | {} |\n", what, known, ours); };
    show("nothing (cells of two sizes, cut by the surface)", 6, count({}, 0));
    show("a slanted bone", 1, count({bone}, 0));
    show("a slanted bone and its tube", 0, count({bone}, 10));
    show("two bones", 0, count({bone, other}, 0));
}

void energy()
{
    title("What a step of implicit Euler leaves of a mode's energy, 1 / (1 + z²)",
          "mode, step | known | ours | difference");
    FleshSettings settings;
    settings.law = FleshLaw::Linear;
    settings.tolerance = 1e-14;
    const Lattice lattice = bar_lattice(1, 4);
    Flesh flesh(lattice, {{1e4, 0.3, 1000}}, held_nodes(lattice, is_held), {}, settings);
    const Modes modes = modes_of(flesh);
    for (const int mode : {0, 5, 30})
        for (const double dt : {1e-3, 1e-2})
            row(fmt::format("{}, {} s", mode + 1, dt),
                1.0 / (1.0 + dt * dt * modes.eigenvalues()[mode]),
                energy_left(flesh, modes, mode, dt));
    settings.gravity = {0, 0, -9.81};
    Flesh falls(bar_lattice(1, 3), {{1e4, 0.4, 1000}}, {}, {}, settings);
    FleshState state = falls.rest();
    for (int k = 0; k < 100; ++k)
        falls.step(state, 0.01, {});
    row("free fall, 1 s by 0.01 s [m]", 4.95405, -state.u[2]);
}

void spin()
{
    title("Steady spin, once round: farthest from the rigid motion [length]",
          "turn a step [rad] | known | ours");
    for (const auto& [turn, known] : {std::pair{0.2, 5e-4}, {0.1, 3e-4}, {0.05, 1e-4}})
    {
        FleshSettings settings;
        settings.tolerance = 1e-9;
        Lattice lattice = bar_lattice(2, 4);
        const std::vector<BoneLine> lines = {{{0, .5, .5}, {4, .5, .5}, 0}};
        std::vector<HeldPoint> points =
            points_on_bones(lattice, lines, [](int, const Vector3d&) { return true; });
        Flesh flesh(std::move(lattice), {{1e6, 0.4, 1.0}}, std::move(points), {},
                    settings);
        FleshState state = flesh.rest();
        const Vector3d centre(0, .5, .5);
        state.v = field_of(flesh.lattice(),
                           [&](const Vector3d& x) -> Vector3d
                           { return Vector3d::UnitZ().cross(x - centre); });
        Motion T;
        for (int k = 1; k <= std::lround(2.0 * std::numbers::pi / turn); ++k)
        {
            T = about(Vector3d::UnitZ(), turn * k, centre);
            flesh.step(state, turn, std::vector<Motion>{T});
        }
        double worst = 0.0;
        for (std::size_t n = 0; n < flesh.lattice().places.size(); ++n)
        {
            const Vector3d& x = flesh.lattice().places[n];
            worst = std::max(worst,
                             (x + state.u.segment<3>(Eigen::Index(3 * n)) - T(x)).norm());
        }
        fmt::print("| {} | {:.1e} | {:.1e} |\n", turn, known, worst / 4.0);
    }
}

/// A closed cylinder of radius 1 along x from 0 to 4, turned about its middle.
Shape cylinder(const Eigen::Matrix3d& R, const Vector3d& shift)
{
    constexpr int kAround = 48;
    Shape shape;
    const Vector3d middle(2, 0, 0);
    for (const double x : {0.0, 4.0})
    {
        for (int k = 0; k < kAround; ++k)
        {
            const double a = 2.0 * std::numbers::pi * k / kAround;
            shape.samples.emplace_back(x, std::cos(a), std::sin(a));
        }
        shape.samples.emplace_back(x, 0, 0);
    }
    const std::uint32_t far = kAround + 1;
    for (std::uint32_t k = 0; k < kAround; ++k)
    {
        const std::uint32_t next = (k + 1) % kAround;
        shape.triangles.push_back({k, next, far + k});
        shape.triangles.push_back({next, far + next, far + k});
        shape.triangles.push_back({std::uint32_t(kAround), next, k});
        shape.triangles.push_back({far + kAround, far + k, far + next});
    }
    for (Vector3d& x : shape.samples)
        x = R * (x - middle) + shift;
    return shape;
}

void slanted_bones()
{
    title("Cylinder (radius 1, length 4) around its bone, force 1 across: mean sag",
          "edge of the cells, seed | truth | ours | share");
    std::mt19937 rng(1);
    for (const double edge : {0.5, 0.7})
        for (int seed = 0; seed < 5; ++seed)
        {
            const Eigen::Matrix3d R = random_rotation(rng);
            Shape shape = cylinder(R, Vector3d::Zero());
            Vector3d low = shape.samples.front(), high = low;
            for (const Vector3d& x : shape.samples)
            {
                low = low.cwiseMin(x);
                high = high.cwiseMax(x);
            }
            for (Vector3d& x : shape.samples)
                x -= low;
            const double across = (high - low).maxCoeff() / edge;
            const Built body =
                built(shape, static_cast<int>(std::lround(across)), 0, Fill::Solid, 0.06);
            const Vector3d from = R * Vector3d(-2, 0, 0) - low,
                           to = R * Vector3d(2, 0, 0) - low;
            FleshSettings settings;
            settings.law = FleshLaw::Linear;
            settings.tolerance = 1e-9;
            settings.gravity = R * Vector3d::UnitY();
            Flesh flesh = flesh_of(body, 1.0, {{from, to, 0}}, 0.3, 10.0, {1.0, 0.3, 1.0},
                                   settings);
            FleshState state = flesh.rest();
            flesh.settle(state, std::vector<Motion>(1));
            double sag = 0.0, volume = 0.0;
            for (const LatticePart& part : flesh.lattice().parts)
            {
                const std::array<double, 8> shares =
                    corner_shares(*local_place(flesh.lattice(), part.cell, part.centre));
                for (std::size_t k = 0; k < 8; ++k)
                    sag +=
                        part.volume * shares[k] *
                        state.u.segment<3>(3 * flesh.lattice().cells[idx(part.cell)][k])
                            .dot(settings.gravity);
                volume += part.volume;
            }
            fmt::print("| {}, {} | 0.666 | {:.3f} | {:.2f} |\n", edge, seed + 1,
                       sag / volume, sag / volume / 0.666);
        }
}

void stability()
{
    title("Elbow thrown to 90° in 20 steps, 60 steps, largest displacement [length]",
          "step [ms] | E = 1e-2 Pa | 1e4 | 1e10");
    for (const double dt : {1e-4, 1e-3, 1.0 / 120, 2e-2, 5e-2})
    {
        fmt::print("| {:.3g} |", 1e3 * dt);
        for (const double young : {1e-2, 1e4, 1e10})
        {
            double worst = 0.0;
            for (const double poisson : {0.0, 0.4, 0.499})
            {
                FleshSettings settings;
                settings.gravity = {0, -9.81, 0};
                settings.tolerance = 1e-6;
                Lattice lattice = bar_lattice(2, 4);
                const std::vector<BoneLine> lines = {{{0, .5, .5}, {2, .5, .5}, 0},
                                                     {{2, .5, .5}, {4, .5, .5}, 1}};
                std::vector<HeldPoint> points = points_on_bones(
                    lattice, lines, [](int, const Vector3d&) { return true; });
                Flesh flesh(std::move(lattice), {{young, poisson, 1000.0}},
                            std::move(points), {}, settings);
                FleshState state = flesh.rest();
                for (int k = 1; k <= 60; ++k)
                {
                    const double angle = std::min(1.0, k / 20.0) * std::numbers::pi / 2.0;
                    const FleshReport report =
                        flesh.step(state, dt,
                                   std::vector<Motion>{
                                       {}, about(Vector3d::UnitZ(), angle, {2, .5, .5})});
                    worst = report.is_finite
                                ? std::max(worst, state.u.cwiseAbs().maxCoeff())
                                : INFINITY;
                }
            }
            fmt::print(" {:.3g} |", worst / 4.0);
        }
        fmt::print("\n");
    }
}

} // namespace

int main()
{
    fmt::print("# Flesh against the numbers of its theory\n\nMade by `scripts/bench "
               "flesh_answers`. Known numbers are those of prototypes, of Ritz "
               "approximations and of [MacNealHarder85]; differences are relative.\n");
    cantilever();
    cantilever_by_law();
    cantilever_of_tetrahedra();
    thin_beam();
    free_cube();
    patch_test();
    rigid_modes();
    energy();
    joints();
    laws_in_time();
    spin();
    slanted_bones();
    stability();
}
