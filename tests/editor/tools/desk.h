// SPDX-License-Identifier: GPL-3.0-or-later
// A view with a hand in it, for tests of what the hand does.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "editor/tools/interaction.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"

namespace cellwarp::core::support
{

/// A bar of 3 x 1 x 1 along x in a view from the front, and a hand that works on it.
struct Desk
{
    Folder folder;
    Editing editing;
    Interaction hand;

    Desk() : Desk(bar) {}
    /// \p write: a model or scene into a folder, which gives its path.
    explicit Desk(const std::function<std::string(const Folder&)>& write)
        : editing(document_of(write(folder))), hand(editing)
    {
        editing.wait();
        hand.resize(900, 600);
        frame();
        key('1', {}, true);
        key('5', {}, true); // in parallel projection pixels are easy to tell
        frame();
        hand.wait();
    }
    static std::string bar(const Folder& folder)
    {
        return folder.write("bar.obj", obj_text(box_shape({0, 0, 0}, {3, 1, 1}, 6)));
    }
    /// The bar with two bones along it; \p of_skeleton and \p of_scene: further keys.
    static std::string limb(const Folder& folder, const std::string& of_skeleton = "",
                            const std::string& of_scene = "")
    {
        bar(folder);
        return folder.write("limb.json", R"({"cellwarp": 1, "model": "bar.obj",
            "skeleton": {"joints": [
                {"name": "root", "parent": null, "at": [0.1, 0.5, 0.5]},
                {"name": "knee", "parent": "root", "at": [1.5, 0.5, 0.5]},
                {"name": "foot", "parent": "knee", "at": [2.9, 0.5, 0.5]}])" +
                                             of_skeleton + "}" + of_scene + "}");
    }
    /// In few cells.
    static Document document_of(const std::string& model)
    {
        Document document(model, "");
        SceneSettings settings;
        settings.cells.across = 6;
        settings.cells.max_depth = 0;
        document.change_settings(settings);
        return document;
    }
    Document& document() { return editing.document(); }
    void frame()
    {
        editing.update();
        hand.update();
    }
    /// Until what is shown is what the edits come to.
    void settle()
    {
        editing.wait();
        frame();
        hand.wait();
    }
    void key(char character, const Modifiers& modifiers = {}, bool is_keypad = false)
    {
        hand.key({Key::Character, character, is_keypad, modifiers});
    }
    void key(Key what) { hand.key({what, 0, false, {}}); }
    void keys(const std::string& characters)
    {
        for (const char character : characters)
            key(character);
    }
    /// Of a point of the model.
    Eigen::Vector2d pixel(const Eigen::Vector3d& point) const
    {
        return hand.camera().project(editing.view_frame().to_work(point))->head<2>();
    }
    void move(const Eigen::Vector2d& to, const Modifiers& modifiers = {})
    {
        hand.pointer_moved(to, modifiers);
    }
    void press(const Eigen::Vector2d& at, const Modifiers& modifiers = {},
               Button button = Button::Left)
    {
        move(at, modifiers);
        hand.button(button, true, modifiers);
    }
    void release(const Modifiers& modifiers = {}, Button button = Button::Left)
    {
        hand.button(button, false, modifiers);
        frame();
        hand.wait();
    }
    void drag(const Eigen::Vector2d& from, const Eigen::Vector2d& to,
              const Modifiers& modifiers = {}, Button button = Button::Left)
    {
        press(from, modifiers, button);
        for (int i = 1; i <= 10; ++i)
        {
            move(from + i / 10.0 * (to - from), modifiers);
            frame();
        }
        release(modifiers, button);
    }
    void click(const Eigen::Vector2d& at, const Modifiers& modifiers = {})
    {
        press(at, modifiers);
        release(modifiers);
    }
    /// Samples between two places along the bar, by a box through it.
    void select(double low, double high, const Modifiers& modifiers = {})
    {
        hand.set_tool(Tool::Box);
        drag(pixel({low, -0.2, 0.5}), pixel({high, 1.2, 0.5}), modifiers);
    }
    /// The left end fixed, the right one a handle.
    void start()
    {
        select(-0.1, 0.1);
        key('j');
        select(2.9, 3.1);
        key('h');
        key('5'); // its arrows
        frame();
    }
    const EditedRegion& region(const std::string& name)
    {
        return *document().region(name);
    }
    /// Edits of the hand: the settings were one.
    std::size_t depth() { return document().history().position() - 1; }
    std::string last_edit() { return document().history().name(depth()); }
    std::optional<GizmoPart> part(GizmoPart::Kind kind, int axis) const
    {
        for (const GizmoPart& part : hand.gizmo())
            if (part.kind == kind && part.axis == axis)
                return part;
        return std::nullopt;
    }
    /// Where a hand takes hold of a part.
    Eigen::Vector2d on(GizmoPart::Kind kind, int axis)
    {
        const GizmoPart found = *part(kind, axis);
        Eigen::Vector3d x = 0.5 * (found.line[0] + found.line[1]);
        if (kind == GizmoPart::Kind::Plane)
            x = 0.5 * (found.line[0] + found.line[2]);
        else if (kind == GizmoPart::Kind::Screen)
            x = 0.5 * (found.line[0] + found.line[found.line.size() / 2]);
        return hand.camera().project(x)->head<2>();
    }
    double pixels_per_unit() const { return (pixel({1, 0, 0}) - pixel({0, 0, 0})).x(); }
};

} // namespace cellwarp::core::support
