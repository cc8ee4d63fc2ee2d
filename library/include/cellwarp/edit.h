// SPDX-License-Identifier: GPL-3.0-or-later
// An edit: regions of a shape, and frames that move them. Its statements are those of a
// handle file (docs/scenes.md), as values or as text.
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <cellwarp/export.h>
#include <cellwarp/points.h>
#include <cellwarp/skeleton.h>

namespace cellwarp
{

/// The samples of a region; the material around them belongs to it as well. Lengths are
/// in model units, or shares of the model's box after Edit::use_relative_units().
class CELLWARP_API Selector
{
public:
    static Selector box(Vec3 low, Vec3 high);
    static Selector sphere(Vec3 centre, double radius);
    static Selector capsule(Vec3 from, Vec3 to, double radius);
    /// All x with normal . x >= offset.
    static Selector halfspace(Vec3 normal, double offset);
    /// Sample numbers from 0, in any order. Samples at the places of these belong to the
    /// region too.
    static Selector indices(std::span<const std::uint32_t> samples);
    static Selector indices(std::span<const std::int64_t> samples);
    /// One entry for each sample: those that are not 0 are chosen.
    static Selector mask(std::span<const std::uint8_t> samples);
    /// Samples of faces in a group of ShapeView::groups, or of an OBJ's groups and
    /// objects.
    static Selector group(std::string name);
    /// Samples with this value in a .sel or .dmat file.
    static Selector labels(std::string file, std::int64_t value);
    static Selector all();

    Selector(const Selector&);
    Selector& operator=(const Selector&);
    Selector(Selector&&) noexcept;
    Selector& operator=(Selector&&) noexcept;
    ~Selector();

private:
    friend struct Access;
    struct Data;
    explicit Selector(Data data);
    std::unique_ptr<Data> data_;
};

/// One step of a region's motion from rest; several are applied in their order.
struct Operation
{
    enum class Kind
    {
        Translate, ///< by `vector`
        Rotate,    ///< `degrees` about the axis `vector`
        Matrix,    ///< `matrix`: rigid to 1e-4, made exact from there
        To,        ///< a pin, a point of a rod or a joint goes to the place `vector`
        Turn,      ///< a point of a rod turns by `degrees` about its tangent
        Tangent    ///< the tangent at a point of a rod becomes `vector`
    };
    /// Fixed place of a rotation.
    enum class About
    {
        Centre, ///< of the region's box
        Border, ///< the middle of the glue around the region, as a neck is for a head
        Point   ///< `point`
    };
    Kind kind = Kind::Translate;
    Vec3 vector{};
    double degrees = 0.0; ///< counterclockwise seen against the axis; 360 is a whole turn
    About about = About::Centre;
    Vec3 point{};
    Mat4 matrix = kIdentity;
};
CELLWARP_API Operation translate(Vec3 by);
CELLWARP_API Operation rotate(Vec3 axis, double degrees);
CELLWARP_API Operation rotate_about(Vec3 axis, double degrees, Vec3 point);
CELLWARP_API Operation rotate_about_border(Vec3 axis, double degrees);
CELLWARP_API Operation matrix(const Mat4& rigid);
CELLWARP_API Operation to(Vec3 place);

/// The line of a rod or a curve at rest.
struct SplineLine
{
    enum class Form
    {
        Through, ///< it goes through `points`
        Control, ///< `points` are its control points
        Skeleton ///< the centre line of the limb at region `near`; empty: the longest
                 ///< limb
    };
    Form form = Form::Through;
    std::vector<Vec3> points = {}; ///< two or more; four or more control points
    std::string near = {};
    bool is_closed = false;
    int spans = 4;                        ///< between two points, 1 to 64
    std::optional<double> radius = {};    ///< of the tube that it carries
    std::optional<double> stiffness = {}; ///< > 0: it pushes back; none: it only leads
    bool is_exact = false; ///< samples in the tube end exactly where the rod takes them
};

/// A point of a rod or curve: its number in SplineLine::points, or one of these.
using SplinePoint = std::int64_t;
inline constexpr SplinePoint kWhole = -1, kStart = -2, kEnd = -3;

/// Parts of what holds a rod at a point.
struct Holds
{
    bool place = true, tangent = true, twist = true;
};

/// Regions, and the frames that move them. A statement is checked when it is added, as in
/// a file: Fault::Malformed for numbers that are not finite or out of range, names that
/// are not there, and statements out of place; Fault::Usage for a name that a handle file
/// cannot hold. The edit is then as before. Facts of a model (a group that it lacks, an
/// index beyond its samples, a region without samples) are checked by the call that takes
/// both.
class CELLWARP_API Edit
{
public:
    Edit();
    Edit(const Edit&);
    Edit& operator=(const Edit&);
    Edit(Edit&&) noexcept;
    Edit& operator=(Edit&&) noexcept;
    ~Edit();

    /// A handle file, or its text. Throws Fault::File, Fault::Malformed with the line.
    static Edit read(const std::string& path);
    static Edit parse(std::string_view text);
    /// The edit of a scene file: its handle file, and its skeleton's keys as frames.
    /// Warnings are appended to \p warnings.
    static Edit read_scene(const std::string& path,
                           std::vector<std::string>* warnings = {});
    /// A pair of the deformation survey: a .sel and a .def file.
    static Edit read_survey_pair(const std::string& sel, const std::string& def);
    /// Text of a handle file that parses to the same numbers, to the bit. Times of frames
    /// are not part of it.
    std::string text() const;

    /// From here on lengths are shares of the model's box, radii of its diagonal. It
    /// comes before the first region.
    Edit& use_relative_units();

    /// A second region statement of the same name and kind adds to the region.
    Edit& fixed(const std::string& name, const Selector& where);
    Edit& handle(const std::string& name, const Selector& where);
    /// A pin of one place: the place is held, and the material turns freely about it. A
    /// pin of several places is one rigid body whose turn is found.
    Edit& pin(const std::string& name, const Selector& where);
    /// Glue inside is \p factor times as stiff; > 0.
    Edit& stiff(const std::string& name, const Selector& where, double factor);
    Edit& rod(const std::string& name, const SplineLine& line);
    Edit& curve(const std::string& name, const SplineLine& line); ///< a guide alone
    /// A pin of one place stays on a rod or curve. \p at: share of its rest length; none:
    /// the pin slides.
    Edit& on(const std::string& pin, const std::string& guide,
             std::optional<double> at = {});
    /// Bones that pose the material (docs/skeleton.md); parents come before their
    /// children.
    Edit& skeleton(std::span<const Joint> joints);

    /// Statements behind it happen in this frame; numbers rise, 0 to 999999999.
    Edit& frame(std::int64_t number);
    /// Absolute, from rest: it replaces the region's earlier moves.
    Edit& move(const std::string& region, std::span<const Operation> operations);
    Edit& move(const std::string& region, std::initializer_list<Operation> operations);
    Edit& move(const std::string& rod, SplinePoint point,
               std::span<const Operation> operations);
    Edit& move(const std::string& rod, SplinePoint point,
               std::initializer_list<Operation> operations);
    /// A point of a rod is no longer held.
    Edit& release(const std::string& rod, SplinePoint point, Holds released = {});
    /// A joint turns, or goes to a place and the chain of joints from \p from on turns
    /// for it; empty: the chain begins behind the next branch.
    Edit& pose(const std::string& joint, std::span<const Operation> operations,
               const std::string& from = {});
    /// The result of the frames so far becomes the rest shape; regions begin anew.
    Edit& commit();

    std::size_t num_frames() const;           ///< of all stages
    std::vector<std::string> regions() const; ///< names of the last stage, in their order

private:
    friend struct Access;
    struct Data;
    explicit Edit(Data data);
    std::unique_ptr<Data> data_;
};

} // namespace cellwarp
