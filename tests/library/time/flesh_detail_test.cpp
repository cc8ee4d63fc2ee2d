// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/flesh_detail.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "library/session/scene_settings.h"
#include "library/time/flesh_simulation.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// A shape 4 long in x whose bone bends it in the middle, up and back within half a
/// second.
struct Bending
{
    support::Folder folder;
    std::string skeleton = R"("E": 1e5, "across": 12, "max_depth": 1, "detail": 0.006,
                               "damping": {"alpha": 20})";
    std::string keys = R"({"time": 0, "joint": "knee", "rotate": [0, 0, 1, 0]},
                          {"time": 0.25, "joint": "knee", "rotate": [0, 0, 1, 40]},
                          {"time": 0.5, "joint": "knee", "rotate": [0, 0, 1, 0]})";
    std::string time = R"("duration": 1.5, "gravity": [0, 0, 0])";
    std::string root = "[0.02, 0, 0]", knee = "[2, 0, 0]", foot = "[3.98, 0, 0]";

    explicit Bending(const Shape& shape = support::box_shape({0, -0.5, -0.5},
                                                             {4, 0.5, 0.5}, 8))
    {
        folder.write("shape.obj", support::obj_text(shape));
    }
    std::unique_ptr<FleshSimulation> start() const
    {
        const SceneFile of = parse_scene(
            folder / "s.json", R"({"cellwarp": 1, "model": "shape.obj", "skeleton": {
                "joints": [{"name": "root", "parent": null, "at": )" +
                                   root + R"(},
                           {"name": "knee", "parent": "root", "at": )" +
                                   knee + R"(},
                           {"name": "foot", "parent": "knee", "at": )" +
                                   foot + R"(}], )" + skeleton + R"(, "keys": [)" + keys +
                                   R"(]}, "simulate": {)" + time + "}}");
        return std::make_unique<FleshSimulation>(
            std::make_shared<const Geometry>(read_geometry(of.model).geometry), of,
            settings_of(of).cells, true);
    }
};

std::size_t cells(const FleshSimulation& of)
{
    return of.body().flesh->lattice().cells.size();
}

/// Lattices that are drawn around the bar.
enum class Kind
{
    Straight,
    Sheared,
    Curved,
    MeetsInAnEdge ///< two halves, of which one is below and one above the axis
};

/// Eight by two by two cells; those of the farther half have the reference 2.
std::string drawn_mesh(Kind kind)
{
    const auto number = [](int i, int j, int k) { return 1 + i + 9 * (j + 3 * k); };
    std::string mesh = "MeshVersionFormatted 2\nDimension 3\nVertices 81\n", cells;
    for (int k = 0; k < 3; ++k)
        for (int j = 0; j < 3; ++j)
            for (int i = 0; i < 9; ++i)
            {
                Vector3d x(0.5 * i, 0.5 * (j - 1), 0.5 * (k - 1));
                if (kind == Kind::Sheared)
                    x = {1.1 * (x.x() - 2.0) + 2.0 + 0.3 * x.y(), x.y(), x.z()};
                if (kind == Kind::Curved)
                    x = {1.1 * (x.x() - 2.0) + 2.0 - 0.3 * x.y() * x.y(),
                         1.1 * x.y() + 0.1 * std::sin(2.0 * x.x()) * (1.0 + x.z()),
                         1.1 * x.z()};
                for (const double c : x)
                    mesh += std::to_string(c) + " ";
                mesh += "0\n";
            }
    int count = 0;
    for (int k = 0; k < 2; ++k)
        for (int j = 0; j < 2; ++j)
            for (int i = 0; i < 8; ++i)
            {
                if (kind == Kind::MeetsInAnEdge && (i < 4) != (j == 0))
                    continue;
                ++count;
                for (const int up : {0, 1})
                    for (const auto& [a, b] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}})
                        cells += std::to_string(number(i + a, j + b, k + up)) + " ";
                cells += i < 4 ? "1\n" : "2\n";
            }
    return mesh + "Hexahedra " + std::to_string(count) + "\n" + cells;
}

Bending in_drawn(Kind kind,
                 const std::string& more = R"(, "max_depth": 1, "detail": 0.006)")
{
    Bending bar;
    bar.folder.write("bar.mesh", drawn_mesh(kind));
    bar.skeleton = R"("E": 1e5, "lattice": "bar.mesh", "damping": {"alpha": 20})" + more;
    return bar;
}

} // namespace

TEST(FleshDetail, comes_where_flesh_bends_and_leaves_when_it_is_at_rest)
{
    const Bending bar;
    const auto simulation = bar.start();
    const std::size_t first = cells(*simulation);
    std::size_t most = first, split = 0, merged = 0;
    while (simulation->steps_done() < simulation->num_steps())
    {
        simulation->next_frame();
        const SimulationReport frame = simulation->report();
        EXPECT_TRUE(frame.is_converged);
        EXPECT_LT(frame.violation, 1e-12);
        split += frame.flesh->split;
        merged += frame.flesh->merged;
        most = std::max(most, cells(*simulation));
    }
    EXPECT_GT(most, first + 50);
    EXPECT_LT(most, 8 * first);
    EXPECT_EQ(cells(*simulation), first);
    EXPECT_GT(split, 7u);
    EXPECT_GT(merged, 7u);
    EXPECT_TRUE(simulation->warnings().empty());
}

TEST(FleshDetail, comes_and_leaves_in_drawn_lattices)
{
    for (const Kind kind :
         {Kind::Straight, Kind::Sheared, Kind::Curved, Kind::MeetsInAnEdge})
    {
        const Bending bar = in_drawn(kind);
        const auto simulation = bar.start();
        const std::size_t first = cells(*simulation);
        EXPECT_EQ(first, kind == Kind::MeetsInAnEdge ? 16u : 32u);
        const double mass = simulation->body().mass;
        std::size_t most = first;
        while (simulation->steps_done() < simulation->num_steps())
        {
            simulation->next_frame();
            const SimulationReport frame = simulation->report();
            EXPECT_TRUE(frame.is_converged);
            EXPECT_LT(frame.violation,
                      0.05); // as larger cells have it, for a little while
            EXPECT_NEAR(simulation->body().mass, mass, 1e-9 * mass);
            most = std::max(most, cells(*simulation));
        }
        EXPECT_GT(most, first + 30);
        EXPECT_LT(most, 8 * first);
        EXPECT_EQ(cells(*simulation), first);
        EXPECT_LT(simulation->report().violation, 1e-9);
    }
}

namespace
{

/// The flesh of a simulation, whose detail is looked at by hand.
struct Look
{
    FleshBody body;
    FleshDetail detail;
    FleshState state;

    explicit Look(const FleshSimulation& of)
        : body(of.body()), detail(of.snapshot().detail), state(of.snapshot().state)
    {
    }
    DetailChange change(double threshold, std::int64_t step, std::int64_t most = 100000)
    {
        const std::vector<double> errors = uneven_strains(body, state);
        const std::vector<char> is_wanted(errors.size(), 0);
        const auto time = static_cast<double>(step); // steps of a second
        return change_detail(body, {errors, is_wanted, threshold, time, step, 30, most},
                             detail);
    }
    /// To the lattice that is wanted now. Expects that samples stay where they are, and
    /// as fast, and that the momentum is the same.
    void go_on(double end_of_fading)
    {
        FleshBody next = build_flesh(body.model, *detail.octree, *detail.coarser);
        CarriedState carried = carried_to(next, body, state);
        double most = 0.0;
        for (std::size_t i = 0; i < body.cell_of_sample.size(); ++i)
        {
            const FleshPoint a = body.point_of_sample(i), b = next.point_of_sample(i);
            for (const auto& [before, after] :
                 {std::pair(&state.u, &carried.state.u), {&state.v, &carried.state.v}})
                most = std::max(
                    most,
                    (at_point(a.shares, *before) - at_point(b.shares, *after)).norm());
        }
        EXPECT_LT(most, 1e-11);
        const Vector3d momentum = body.flesh->momentum(state);
        EXPECT_LT((next.flesh->momentum(carried.state) - momentum).norm(),
                  1e-11 * body.mass);
        detail.fading.assign(next.own_motions.size(), {});
        for (Fading& fading : detail.fading)
            fading.end = end_of_fading;
        body = std::move(next);
        state = std::move(carried.state);
    }
    double kinetic() const
    {
        const std::vector<Motion> at_rest(body.first_own_motion() +
                                          body.own_motions.size());
        return body.flesh->energies(state, at_rest).kinetic;
    }
};

} // namespace

TEST(FleshDetail, neither_places_nor_speeds_change_with_a_lattice)
{
    // In the L-prism coarse cells have corners that no fine cell has.
    struct Scene
    {
        Bending (*made)();
        bool is_exact; // integrals of whole cubes and slanted cells
    };
    static const char* const drawn = R"(, "max_depth": 2, "detail": 0.1)";
    for (const Scene& scene :
         {Scene{[] { return Bending(); }, true},
          {[] { return Bending(support::l_prism()); }, false},
          {[] { return in_drawn(Kind::Sheared, drawn); }, true},
          {[] { return in_drawn(Kind::Curved, drawn); }, false},
          {[] { return in_drawn(Kind::MeetsInAnEdge, drawn); }, true}})
    {
        const Bending bending = scene.made();
        const auto simulation = bending.start();
        for (int frame = 0; frame < 9; ++frame)
            simulation->next_frame();
        Look look(*simulation);
        const double energy = look.kinetic();
        ASSERT_TRUE(look.change(1e-4, 36).has_changed);
        look.go_on(66.0);
        EXPECT_GT(look.detail.octree->leaves().size(),
                  simulation->snapshot().detail.octree->leaves().size());
        if (scene.is_exact)
        {
            EXPECT_NEAR(look.kinetic(), energy, 1e-12 * energy);
        }
        // Everything becomes idle, and leaves: nodes are as they were, and on their way.
        const std::size_t fine = look.detail.octree->leaves().size();
        EXPECT_FALSE(look.change(1e3, 40).has_changed);
        EXPECT_FALSE(look.change(1e3, 69).has_changed);
        ASSERT_TRUE(look.change(1e3, 70).has_changed);
        EXPECT_EQ(look.detail.octree->leaves().size(), fine);
        EXPECT_LT(look.detail.coarser->leaves().size(), fine);
        look.go_on(100.0);
        EXPECT_GT(look.body.leaving.nodes.size(), 20u);
        // They have come there: then the coarser lattice is the same.
        for (const LeavingNodes::Node& node : look.body.leaving.nodes)
            for (Eigen::VectorXd* x : {&look.state.u, &look.state.v})
                x->segment<3>(3 * node.node) = at_point(node.parents, *x);
        const Lattice& lattice = look.body.flesh->lattice();
        for (std::size_t n = 0; n < lattice.hanging.size(); ++n)
            if (!lattice.hanging[n].empty())
                for (Eigen::VectorXd* x : {&look.state.u, &look.state.v})
                    x->segment<3>(Eigen::Index(3 * n)) = at_point(lattice.hanging[n], *x);
        EXPECT_FALSE(look.change(1e3, 99).has_changed);
        const DetailChange change = look.change(1e3, 100);
        ASSERT_TRUE(change.has_changed);
        EXPECT_GT(change.merged, 5u);
        look.go_on(130.0);
        EXPECT_LT(look.detail.octree->leaves().size(), fine);
    }
}

TEST(FleshDetail, what_was_idle_is_kept_where_it_bends_again)
{
    const Bending bar;
    const auto simulation = bar.start();
    for (int frame = 0; frame < 9; ++frame)
        simulation->next_frame();
    Look look(*simulation);
    ASSERT_TRUE(look.change(1e-4, 36).has_changed);
    look.go_on(66.0);
    const std::shared_ptr<const Octree> fine = look.detail.octree;
    look.change(1e3, 40);
    ASSERT_TRUE(look.change(1e3, 70).has_changed);
    look.go_on(100.0);
    ASSERT_TRUE(look.change(1e-9, 80).has_changed);
    EXPECT_TRUE(look.detail.leaving.empty());
    EXPECT_TRUE(look.detail.idle.empty());
    look.go_on(110.0);
    EXPECT_TRUE(look.body.leaving.nodes.empty());
    EXPECT_GE(look.detail.octree->leaves().size(), fine->leaves().size());
    // There is room for some alone: the worst ones.
    Look full(*simulation);
    const auto most = static_cast<std::int64_t>(full.detail.octree->leaves().size()) + 60;
    const DetailChange change = full.change(1e-4, 36, most);
    EXPECT_TRUE(change.is_full);
    EXPECT_GT(change.split, 0u);
    EXPECT_LE(full.detail.octree->leaves().size(), std::size_t(most));
    Look none(*simulation);
    EXPECT_EQ(none.change(1e-4, 36, 1).split, 0u);
    EXPECT_EQ(none.detail.octree->leaves(),
              simulation->snapshot().detail.octree->leaves());
}

TEST(FleshDetail, a_frame_depends_on_its_snapshot_alone)
{
    for (const char* more :
         {R"("across": 8, "law": "cells")", R"("across": 8, "law": "regions")",
          R"("lattice": "bar.mesh", "law": "cells")",
          R"("lattice": "bar.mesh", "law": "regions")"})
    {
        Bending bar = in_drawn(Kind::Sheared);
        bar.skeleton = R"("E": 1e5, "max_depth": 1, "detail": 0.01,
                          "damping": {"alpha": 20}, )" +
                       std::string(more);
        const auto simulation = bar.start();
        for (int frame = 0; frame < 12; ++frame)
            simulation->next_frame();
        const FleshSimulation::Snapshot snapshot = simulation->snapshot();
        const auto end_of = [](FleshSimulation& of)
        {
            for (int frame = 0; frame < 24; ++frame)
                of.next_frame();
            return of.snapshot();
        };
        const FleshSimulation::Snapshot first = end_of(*simulation);
        EXPECT_NE(first.detail.octree->leaves(), snapshot.detail.octree->leaves());
        const std::vector<Vector3d> samples = simulation->deformed().samples;
        simulation->go_to(snapshot);
        EXPECT_EQ(end_of(*simulation).state, first.state);
        const auto other = bar.start();
        other->go_to(snapshot);
        EXPECT_EQ(end_of(*other).state, first.state);
        EXPECT_EQ(other->deformed().samples, samples);
    }
}

TEST(FleshDetail, leaves_a_bent_knee_without_a_jolt)
{
    // Nothing but the hand asks for detail; when it lets go the knee stays bent.
    Bending bar;
    bar.skeleton = R"("E": 1e5, "across": 12, "max_depth": 1, "detail": 1.0,
                      "damping": {"alpha": 20})";
    bar.keys = R"({"time": 0, "joint": "knee", "rotate": [0, 0, 1, 60]})";
    const auto simulation = bar.start();
    const std::vector<Vector3d> bent = simulation->deformed_live().samples;
    const std::vector<Vector3d>& rest = simulation->geometry().samples;
    const std::size_t inner =
        idx(std::min_element(rest.begin(), rest.end(),
                             [](const auto& a, const auto& b)
                             {
                                 const Vector3d at(2, 0.5, 0);
                                 return (a - at).norm() < (b - at).norm();
                             }) -
            rest.begin());
    simulation->pull(FleshPull{inner, bent[inner]});
    for (int frame = 0; frame < 10; ++frame)
        simulation->next_frame();
    const std::size_t most = cells(*simulation);
    simulation->pull({});
    std::vector<Vector3d> before, now = simulation->deformed_live().samples;
    double jolt = 0.0, way = 0.0;
    const std::vector<Vector3d> first = now;
    for (int step = 0; step < 90; ++step)
    {
        simulation->step();
        std::vector<Vector3d> next = simulation->deformed_live().samples;
        for (std::size_t i = 0; i < next.size() && step > 10; ++i)
        {
            jolt = std::max(jolt, (next[i] - 2.0 * now[i] + before[i]).norm());
            way = std::max(way, (next[i] - first[i]).norm());
        }
        before = std::move(now);
        now = std::move(next);
    }
    EXPECT_LT(cells(*simulation), most);
    EXPECT_LT(jolt, 0.1 * way);
}

TEST(FleshDetail, even_strain_needs_none_and_rigid_motion_less)
{
    for (const char* const cut : {R"("across": 12)", R"("lattice": "bar.mesh")"})
    {
        Bending bar = in_drawn(Kind::Sheared);
        bar.skeleton =
            R"("E": 1e5, "max_depth": 1, "detail": 0.006, )" + std::string(cut);
        const auto simulation = bar.start();
        FleshState state = simulation->snapshot().state;
        const Lattice& lattice = simulation->body().flesh->lattice();
        Eigen::Matrix3d A;
        A << 0.3, 0.1, -0.2, 0.0, -0.1, 0.4, 0.2, 0.1, 0.5;
        for (std::size_t n = 0; n < lattice.places.size(); ++n)
            state.u.segment<3>(Eigen::Index(3 * n)) = A * lattice.places[n];
        for (const double error : uneven_strains(simulation->body(), state))
            EXPECT_LT(error, 1e-12);
        // A bent bar: halved cells have a quarter of the error.
        const auto bent = [](const FleshBody& body)
        {
            const Lattice& of = body.flesh->lattice();
            FleshState out = body.flesh->rest();
            for (std::size_t n = 0; n < of.places.size(); ++n)
            {
                const Vector3d& x = of.places[n];
                out.u.segment<3>(Eigen::Index(3 * n)) =
                    Vector3d(-0.05 * x.x() * x.y(), 0.025 * x.x() * x.x(), 0.0);
            }
            const std::vector<double> errors = uneven_strains(body, out);
            return *std::max_element(errors.begin(), errors.end());
        };
        const FleshBody& coarse = simulation->body();
        const Octree octree = simulation->snapshot().detail.octree->split_all(
            1, coarse.model->has_material());
        const FleshBody fine = build_flesh(coarse.model, octree, octree);
        EXPECT_NEAR(bent(fine) / bent(coarse), 0.25, 0.02);
    }
}

TEST(FleshDetail, is_where_something_touches_is_pulled_or_was_asked_for)
{
    const auto level_at = [](const FleshSimulation& of, std::size_t sample)
    {
        const FleshBody& body = of.body();
        const LatticeBox& box =
            body.flesh->lattice().boxes[idx(body.cell_of_sample[sample])];
        return (*body.tree)[body.tree->find(box.corner)].level;
    };
    const auto sample_near = [](const FleshSimulation& of, const Vector3d& x)
    {
        const std::vector<Vector3d>& samples = of.geometry().samples;
        return idx(std::min_element(samples.begin(), samples.end(),
                                    [&](const Vector3d& a, const Vector3d& b)
                                    { return (a - x).norm() < (b - x).norm(); }) -
                   samples.begin());
    };
    for (const char* const lattice : {R"("across": 8)", R"("lattice": "bar.mesh")"})
    {
        Bending bar = in_drawn(Kind::Straight);
        bar.keys = "";
        const std::string usual =
            R"("E": 1e5, "max_depth": 2, "detail": 0.2, )" + std::string(lattice);
        bar.skeleton = usual + R"(, "detail_regions": ["box 3.5 -1 -1 5 1 1"])";
        const auto asked = bar.start();
        const std::size_t tip = sample_near(*asked, {4, 0.5, 0.5}),
                          root = sample_near(*asked, {0, 0.5, 0.5});
        EXPECT_EQ(level_at(*asked, tip), 2);
        EXPECT_EQ(level_at(*asked, root), 0);
        for (int frame = 0; frame < 20; ++frame)
            asked->next_frame();
        EXPECT_EQ(level_at(*asked, tip), 2); // it does not leave
        bar.skeleton = usual + R"(, "obstacles": [{"sphere": [4, 1.25, 0.5, 0.76]}])";
        const auto touched = bar.start();
        for (int frame = 0; frame < 6; ++frame)
            touched->next_frame();
        EXPECT_GT(touched->report().flesh->contacts, 0u);
        EXPECT_EQ(level_at(*touched, tip), 2);
        EXPECT_EQ(level_at(*touched, root), 0);
        bar.skeleton = usual;
        const auto pulled = bar.start();
        pulled->pull(FleshPull{tip, {4, 0.6, 0.5}});
        for (int frame = 0; frame < 6; ++frame)
            pulled->next_frame();
        EXPECT_EQ(level_at(*pulled, tip), 2);
        pulled->pull({});
        for (int frame = 0; frame < 40; ++frame)
            pulled->next_frame();
        EXPECT_EQ(level_at(*pulled, tip), 0);
    }
}

TEST(FleshDetail, materials_of_a_drawn_lattice_are_those_of_its_drawn_cells)
{
    // The border of the region cuts cells: their middles count, halved or not.
    for (const char* const of :
         {R"("region": "box 2.2 -9 -9  9 9 9")", R"("reference": 2)"})
    {
        const Bending bar = in_drawn(
            Kind::Straight, R"(, "max_depth": 2, "detail": 0.002, "materials": [{)" +
                                std::string(of) + R"(, "density": 500}])");
        const auto simulation = bar.start();
        const std::size_t first = cells(*simulation);
        for (int frame = 0; frame < 10; ++frame)
            simulation->next_frame();
        EXPECT_GT(cells(*simulation), 2 * first);
        EXPECT_NEAR(simulation->body().mass, 3000.0, 1e-6);
        for (const LatticePart& part : simulation->body().flesh->lattice().parts)
            EXPECT_EQ(part.material,
                      simulation->body().model->to_model(part.centre).x() > 2.0);
    }
}

TEST(FleshDetail, bones_on_edges_of_a_drawn_lattice_hold_all_nodes_on_them)
{
    Bending bar = in_drawn(Kind::Straight, R"(, "max_depth": 2, "detail": 0.002)");
    // The axis from 0.5 to 2, and from there to 3.5.
    std::string edges = "Edges 6\n";
    for (int i = 1; i < 7; ++i)
        edges += std::to_string(37 + i) + " " + std::to_string(38 + i) + " 0\n";
    bar.folder.write("bar.mesh", drawn_mesh(Kind::Straight) + edges);
    bar.root = "[0.5, 0, 0]";
    bar.foot = "[3.5, 0, 0]";
    const auto simulation = bar.start();
    EXPECT_EQ(simulation->body().held, 7u);
    std::size_t most = 0;
    while (simulation->steps_done() < simulation->num_steps())
    {
        simulation->next_frame();
        EXPECT_LT(simulation->report().violation, 1e-12);
        most = std::max(most, simulation->body().held);
    }
    EXPECT_GT(most, 12u);
}

TEST(FleshDetail, drawn_cells_whose_parts_would_be_inside_out_are_refused)
{
    Bending bar = in_drawn(Kind::Straight);
    // The middle of an end is pushed in: its corner folds, the rest of the cell does not.
    std::string mesh = drawn_mesh(Kind::Straight);
    const std::string corner = "0.000000 -0.500000 -0.500000";
    mesh.replace(mesh.find(corner), corner.size(), "0.225 -0.275 -0.275");
    bar.folder.write("bar.mesh", mesh);
    const std::string error = support::error_of(Fault::Malformed, [&] { bar.start(); });
    EXPECT_NE(error.find("hexahedron 1 is turned inside out"), std::string::npos)
        << error;
    bar.skeleton = R"("E": 1e5, "lattice": "bar.mesh")";
    EXPECT_NO_THROW(bar.start());
}

TEST(FleshDetail, bones_and_held_points_hold_all_the_time)
{
    Bending bar(support::l_prism());
    bar.skeleton = R"("E": 3e4, "across": 9, "max_depth": 2, "detail": 0.004,
        "held": [{"at": [1.9, 0.2, 0.3]}])";
    bar.time = R"("duration": 0.7)";
    const auto simulation = bar.start();
    std::size_t most = 0;
    while (simulation->steps_done() < simulation->num_steps())
    {
        simulation->step();
        // Off by what lies between the points of larger cells, for a little while.
        EXPECT_LT(simulation->report().violation, 0.05);
        most = std::max(most, cells(*simulation));
    }
    EXPECT_GT(most, 100u);
}

TEST(FleshDetail, points_of_bones_come_to_them_though_cells_keep_changing)
{
    // Between its points a slanted bone is off: smaller cells bring more of it home.
    Bending bar;
    bar.knee = "[2, 0.2, 0.13]";
    bar.foot = "[3.9, -0.3, -0.21]";
    bar.skeleton = R"("E": 3e4, "across": 8, "max_depth": 2, "detail": 0.004,
                      "damping": {"alpha": 8})";
    bar.keys = R"({"time": 0, "joint": "knee", "rotate": [0, 0, 1, 0]},
                  {"time": 0.6, "joint": "knee", "rotate": [0, 0, 1, 60]})";
    bar.time = R"("duration": 1.2, "gravity": [0, 0, 0])";
    const auto simulation = bar.start();
    double most = 0.0, last = 0.0;
    std::size_t changes = 0;
    while (simulation->steps_done() < simulation->num_steps())
    {
        const std::shared_ptr<const Octree> before = simulation->snapshot().detail.octree;
        simulation->step();
        changes += simulation->snapshot().detail.octree != before;
        last = simulation->report().violation;
        most = std::max(most, last);
        // After a change a point goes on as fast as it was.
        const FleshBody& body = simulation->body();
        const FleshSimulation::Snapshot& now = simulation->snapshot();
        for (std::size_t k = 0;
             now.detail.octree != before && k < body.own_motions.size(); ++k)
            if (const FleshBody::OwnMotion& of = body.own_motions[k]; of.follows >= 0)
            {
                const double h = 1e-6;
                const double time = static_cast<double>(now.steps) / 120.0;
                const Vector3d rate =
                    (now.detail.fading[k].at(time + h) - now.detail.fading[k].at(time)) /
                    h;
                const auto place = [&](const std::vector<Motion>& motions)
                { return motions[idx(of.follows)](of.place); };
                ASSERT_FALSE(now.detail.earlier.empty());
                const Vector3d bone =
                    60.0 * (3.0 * place(now.detail.now) - 4.0 * place(now.detail.before) +
                            place(now.detail.earlier)); // BDF2
                EXPECT_LT((rate + bone - at_point(of.shares, now.state.v)).norm(), 1e-3);
            }
    }
    EXPECT_GT(changes, 5u);
    EXPECT_GT(most, 1e-3);
    EXPECT_LT(last, 1e-8);
}

TEST(FleshDetail, a_first_pose_is_at_rest_with_its_detail)
{
    Bending bar;
    bar.knee = "[2, 0.2, 0.13]";
    bar.foot = "[3.9, -0.3, -0.21]";
    bar.skeleton = R"("E": 3e4, "across": 8, "max_depth": 2, "detail": 0.004)";
    bar.keys = R"({"time": 0, "joint": "knee", "rotate": [0, 0, 1, 50]})";
    bar.time = R"("duration": 0.2, "gravity": [0, 0, 0])";
    const auto simulation = bar.start();
    const std::size_t first = cells(*simulation);
    EXPECT_GT(first, 100u);
    SimulationReport frame = simulation->report();
    EXPECT_GT(frame.elastic, 10.0);
    const double elastic = frame.elastic;
    while (simulation->steps_done() < simulation->num_steps())
    {
        simulation->next_frame();
        frame = simulation->report();
        EXPECT_LT(frame.kinetic, 1e-6 * elastic);
        EXPECT_LT(frame.violation, 1e-9);
    }
    EXPECT_NEAR(frame.elastic, elastic, 1e-4 * elastic);
    EXPECT_EQ(cells(*simulation), first);
}

TEST(FleshDetail, regions_that_a_change_does_not_touch_keep_their_factor)
{
    // Five bones; detail is asked for at the last one alone.
    Bending bar(support::box_shape({0, -0.5, -0.5}, {12, 0.5, 0.5}, 24));
    bar.skeleton = R"("E": 1e5, "across": 36, "max_depth": 1, "detail": 0.5,
                      "law": "regions")";
    bar.keys = "";
    bar.time = R"("duration": 1, "gravity": [0, 0, 0])";
    const auto simulation = bar.start();
    simulation->next_frame();
    // The first step, by implicit Euler, has its own factors beside those of BDF2.
    EXPECT_EQ(simulation->report().flesh->factors, 4);
    simulation->pull(FleshPull{0, {-0.1, -0.5, -0.5}});
    simulation->next_frame();
    simulation->next_frame();
    const SimulationReport frame = simulation->report();
    EXPECT_GT(frame.flesh->split, 0u);
    EXPECT_EQ(frame.flesh->factors, 1);
}

} // namespace cellwarp::core
