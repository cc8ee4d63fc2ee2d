// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/playback.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <sstream>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

class Player
{
public:
    Player(Editor& editor, const std::string& path) : editor_(editor), path_(path) {}

    void run(const Statement& statement);
    bool has_quit() const { return has_quit_; }
    PlaybackReport take_report();

    // One a statement.
    void size();
    void move();
    void press();
    void release();
    void drag();
    void wheel();
    void key();
    void text();
    void wait();
    void frames();
    void shot();
    void tool();
    void region();
    void make();
    void place();
    void point();
    void film();
    void live();
    void show();
    void open();
    void save();
    void export_model();
    void undo();
    void redo();
    void recover();
    void quit();

private:
    [[noreturn]] void fail(const std::string& what) const;
    const std::string& word(std::size_t k) const { return statement_->words[k]; }
    std::size_t num_words() const { return statement_->words.size(); }
    double number(std::size_t k) const;
    int count(std::size_t k) const;
    Eigen::Vector2d point(std::size_t k) const;
    Button button() const;
    Modifiers modifiers(std::size_t first) const;
    OpenedDocument& opened() const;
    FrameParts post(InputEvent event);
    void move_to(const Eigen::Vector2d& place);
    FrameParts press_at(Button button, bool is_pressed);

    Editor& editor_;
    const std::string& path_;
    const Statement* statement_ = nullptr;
    Eigen::Vector2d pointer_ = Eigen::Vector2d::Zero();
    bool has_quit_ = false;
    /// The last event or statement; of one that places a handle, when the hand lets go.
    Clock::time_point begun_ = Clock::now();
    PlaybackReport report_;
};

struct Known
{
    const char* name;
    std::size_t min_words, max_words; ///< after the name
    void (Player::*run)();
    const char* usage;
};

constexpr std::array<Known, 26> kKnown = {{
    {"size", 2, 2, &Player::size, "size W H                 of the window"},
    {"move", 2, 2, &Player::move, "move X Y                 the pointer"},
    {"press", 1, 4, &Player::press, "press left|middle|right [ctrl] [shift] [alt]"},
    {"release", 1, 4, &Player::release, "release left|middle|right [ctrl] [shift] [alt]"},
    {"drag", 5, 6, &Player::drag,
     "drag X0 Y0 X1 Y1 N [BUTTON]   press, N moves, release; each move is timed"},
    {"wheel", 2, 2, &Player::wheel, "wheel DX DY"},
    {"key", 1, 4, &Player::key,
     "key NAME [ctrl] [shift] [alt]   g, 7, ?, enter, kp1, f6, ..."},
    {"text", 1, 100, &Player::text, "text WORDS               as typed"},
    {"wait", 0, 0, &Player::wait,
     "wait                     until what is asked for is there"},
    {"frames", 1, 1, &Player::frames, "frames N"},
    {"shot", 1, 1, &Player::shot, "shot FILE.png|FILE.ppm   of the window"},
    {"tool", 1, 1, &Player::tool, "tool click|box|lasso|brush|move|rotate|rod"},
    {"region", 1, 1, &Player::region, "region NAME              becomes the active one"},
    {"make", 1, 2, &Player::make,
     "make fixed|handle|pin|stiff [NAME]   of the selection"},
    {"place", 4, 11, &Player::place,
     "place REGION X Y Z [AX AY AZ DEGREES [PX PY PZ]]   as the number fields do"},
    {"point", 5, 6, &Player::point,
     "point REGION NUMBER X Y Z [DEGREES]   of a rod or curve, in rest coordinates"},
    {"show", 2, 2, &Player::show,
     "show edges|faces|colours|ghost|floor|cells|wire|dark|keys|panel on|off"},
    {"open", 1, 1, &Player::open, "open FILE"},
    {"film", 1, 1, &Player::film,
     "film FRAME|off           of the scene in time, when it is made"},
    {"live", 1, 1, &Player::live,
     "live SECONDS|off         flesh in real time, until so much has passed in it"},
    {"save", 1, 2, &Player::save,
     "save SCENE.json [poses]  poses: without times, flesh and simulate"},
    {"export", 1, 1, &Player::export_model,
     "export FILE              the model as it is seen: bent, or a frame of the film"},
    {"undo", 0, 0, &Player::undo, "undo"},
    {"redo", 0, 0, &Player::redo, "redo"},
    {"recover", 1, 1, &Player::recover,
     "recover yes|no           the last session's edits"},
    {"quit", 0, 0, &Player::quit, "quit"},
}};

const Known* known_statement(const std::string& name)
{
    const auto* found =
        std::find_if(kKnown.begin(), kKnown.end(),
                     [&](const Known& known) { return name == known.name; });
    return found == kKnown.end() ? nullptr : &*found;
}

void Player::run(const Statement& statement)
{
    statement_ = &statement;
    if (statement.words[0] != "wait")
        begun_ = Clock::now();
    try
    {
        (this->*known_statement(statement.words[0])->run)();
    }
    catch (const Error& error)
    {
        if (error.file() == path_)
            throw;
        throw Error(error.fault(),
                    at({path_, statement.line, statement.words[0]}, error.what()));
    }
}

void Player::fail(const std::string& what) const
{
    throw malformed({path_, statement_->line, statement_->words[0]}, what);
}

double Player::number(std::size_t k) const
{
    const std::optional<double> value = parse_double(word(k));
    if (!value || !std::isfinite(*value))
        fail("a number is needed (got " + in_quotes(word(k)) + ")");
    return *value;
}

int Player::count(std::size_t k) const
{
    const std::optional<std::int64_t> value = parse_integer(word(k));
    if (!value || *value < 1 || *value > 1000000)
        fail("a number from 1 to 1000000 is needed (got " + in_quotes(word(k)) + ")");
    return static_cast<int>(*value);
}

/// Words k and k + 1: pixels of the window, shares of it (0.5w 0.5h), or of the view in
/// it (0.5vw 0.5vh).
Eigen::Vector2d Player::point(std::size_t k) const
{
    const ViewRect& view = editor_.view();
    Eigen::Vector2d place;
    for (int axis = 0; axis < 2; ++axis)
    {
        const std::string& whole = word(k + idx(axis));
        const std::string end = axis == 0 ? "w" : "h";
        std::string digits = whole;
        double low = 0.0, length = 1.0;
        if (whole.ends_with("v" + end))
        {
            digits.resize(whole.size() - 2);
            low = axis == 0 ? view.x : view.y;
            length = axis == 0 ? view.width : view.height;
        }
        else if (whole.ends_with(end))
        {
            digits.resize(whole.size() - 1);
            length = axis == 0 ? editor_.window().width() : editor_.window().height();
        }
        const std::optional<double> value = parse_double(digits);
        if (!value || !std::isfinite(*value))
            fail("a place is needed, as 120, 0.5" + end + " or 0.5v" + end + " (got " +
                 in_quotes(whole) + ")");
        place[axis] = low + *value * length;
    }
    return place;
}

Button Player::button() const
{
    const std::string& name = word(num_words() > 6 ? 6 : 1);
    if (name == "left")
        return Button::Left;
    if (name == "middle")
        return Button::Middle;
    if (name == "right")
        return Button::Right;
    fail("no button " + in_quotes(name) + " (left, middle, right)");
}

Modifiers Player::modifiers(std::size_t first) const
{
    Modifiers held;
    for (std::size_t k = first; k < num_words(); ++k)
    {
        if (word(k) == "ctrl")
            held.control = true;
        else if (word(k) == "shift")
            held.shift = true;
        else if (word(k) == "alt")
            held.alt = true;
        else
            fail("no modifier " + in_quotes(word(k)) + " (ctrl, shift, alt)");
    }
    return held;
}

OpenedDocument& Player::opened() const
{
    if (editor_.app().opened() == nullptr)
        fail("no file is open");
    return *editor_.app().opened();
}

FrameParts Player::post(InputEvent event)
{
    editor_.window().post(std::move(event));
    begun_ = Clock::now();
    FrameParts parts;
    do
        parts = editor_.frame();
    while (editor_.window().has_events());
    return parts;
}

void Player::move_to(const Eigen::Vector2d& place)
{
    pointer_ = place;
    post({.kind = InputEvent::Kind::Move, .place = place});
}

FrameParts Player::press_at(Button button, bool is_pressed)
{
    InputEvent event;
    event.kind = is_pressed ? InputEvent::Kind::Press : InputEvent::Kind::Release;
    event.place = pointer_;
    event.button = button;
    if (statement_->words[0] != "drag")
        event.modifiers = modifiers(2);
    return post(event);
}

void Player::size()
{
    // Drivers draw no larger pictures; some end the program where they are asked to.
    constexpr int kMostPixels = 16384;
    if (std::max(count(1), count(2)) <= kMostPixels)
        editor_.window().resize(count(1), count(2));
    editor_.frame();
    if (editor_.window().width() != count(1) || editor_.window().height() != count(2))
        fail("the display does not make the window that large");
}

void Player::move()
{
    move_to(point(1));
}
void Player::press()
{
    press_at(button(), true);
}
void Player::release()
{
    press_at(button(), false);
}

void Player::drag()
{
    const Eigen::Vector2d from = point(1), to = point(3);
    const int moves = count(5);
    const Button held = num_words() > 6 ? button() : Button::Left;
    DragTimes times;
    times.line = statement_->line;
    move_to(from);
    press_at(held, true);
    for (int k = 1; k <= moves; ++k)
    {
        pointer_ = from + (to - from) * k / moves;
        editor_.window().post({.kind = InputEvent::Kind::Move, .place = pointer_});
        times.frames.push_back(editor_.frame());
        if (editor_.app().opened() == nullptr)
            continue;
        const DragStatus status = editor_.app().opened()->editing.drag_status();
        if (!status.is_dragging || status.frames == times.solved)
            continue;
        times.solved = status.frames;
        times.solve_ms.push_back(status.solve_ms);
        times.blend_ms.push_back(status.blend_ms);
        times.latency_ms.push_back(status.latency_ms);
    }
    const std::clock_t start = std::clock();
    times.release = press_at(held, false);
    times.release_cpu_ms = 1e3 * static_cast<double>(std::clock() - start) /
                           static_cast<double>(CLOCKS_PER_SEC);
    report_.drags.push_back(std::move(times));
}

void Player::wheel()
{
    post({.kind = InputEvent::Kind::Wheel, .place = {number(1), number(2)}});
}

void Player::key()
{
    std::optional<InputEvent> event = key_press(word(1), modifiers(2));
    if (!event)
        fail("no key " + in_quotes(word(1)));
    post(*event);
    event->kind = InputEvent::Kind::KeyUp;
    event->modifiers = {};
    post(*event);
}

void Player::text()
{
    std::string all = word(1);
    for (std::size_t k = 2; k < num_words(); ++k)
        all += " " + word(k);
    for (const char c : all)
    {
        std::optional<InputEvent> event = key_press(std::string(1, c), {});
        if (!event)
            fail("only signs of ASCII can be played");
        editor_.window().post(*event);
        InputEvent typed;
        typed.kind = InputEvent::Kind::Text;
        typed.character = static_cast<unsigned char>(c);
        post(typed);
        event->kind = InputEvent::Kind::KeyUp;
        post(*event);
    }
}

void Player::wait()
{
    editor_.frame();
    if (OpenedDocument* opened = editor_.app().opened())
    {
        opened->hand.wait();
        editor_.frame(); // what it did is asked for
        opened->editing.wait_for_result();
    }
    editor_.frame(); // what came out is seen
    WaitTime& time =
        report_.waits.emplace_back(WaitTime{statement_->line, ms_since(begun_), 0.0});
    if (OpenedDocument* opened = editor_.app().opened())
        opened->editing.wait_for_drag();
    time.ms = ms_since(begun_);
    if (OpenedDocument* opened = editor_.app().opened())
        opened->editing.wait();
    for (int k = 0; k < 2 || !editor_.is_whole(); ++k) // and panels have settled
        editor_.frame();
    if (editor_.app().opened() == nullptr)
        return;
    const SolveStatus status = opened().editing.status();
    if (status.state == SolveStatus::State::Failed)
        throw Error(Fault::Unsolvable, status.error);
}

void Player::frames()
{
    for (int k = count(1); k > 0; --k)
        editor_.frame();
}

void Player::shot()
{
    // Of two frames the second knows how large everything is.
    for (int k = 0; k < 2 || !editor_.is_whole(); ++k)
        editor_.frame();
    const Image image = editor_.image();
    const bool is_ppm = word(1).ends_with(".ppm");
    write_file(word(1), is_ppm ? ppm_bytes(image) : png_bytes(image), Overwrite::Yes);
}

void Player::tool()
{
    constexpr std::array<std::pair<const char*, Tool>, 7> kTools = {
        {{"click", Tool::Click},
         {"box", Tool::Box},
         {"lasso", Tool::Lasso},
         {"brush", Tool::Brush},
         {"move", Tool::Move},
         {"rotate", Tool::Rotate},
         {"rod", Tool::Draw}}};
    for (const auto& [name, known] : kTools)
        if (word(1) == name)
        {
            opened().hand.set_tool(known);
            editor_.frame();
            return;
        }
    fail("no tool " + in_quotes(word(1)) +
         " (click, box, lasso, brush, move, rotate, rod)");
}

void Player::region()
{
    if (opened().editing.document().region(word(1)) == nullptr)
        fail("no region " + in_quotes(word(1)));
    opened().hand.set_active_region(word(1));
    editor_.frame();
}

void Player::make()
{
    for (const Role role : {Role::Fixed, Role::Handle, Role::Pin, Role::Stiff})
        if (word(1) == role_name(role))
        {
            const std::string name = opened().editing.document().add_region(
                role, num_words() > 2 ? word(2) : "");
            opened().hand.set_active_region(name);
            editor_.frame();
            return;
        }
    fail("no role " + in_quotes(word(1)) + " (fixed, handle, pin, stiff)");
}

void Player::place()
{
    if (num_words() != 5 && num_words() != 9 && num_words() != 12)
        fail("a region and 3, 7 or 10 numbers are needed");
    RigidMove placement;
    placement.translation = {number(2), number(3), number(4)};
    if (num_words() > 5)
    {
        const Eigen::Vector3d axis(number(5), number(6), number(7));
        if (!(axis.norm() > 0.0))
            fail("the axis has no length");
        placement.axis = axis.normalized();
        placement.degrees = number(8);
    }
    if (num_words() > 9)
        placement.pivot = Eigen::Vector3d(number(9), number(10), number(11));
    Editing& editing = opened().editing;
    std::string why;
    if (!editing.begin_drag(word(1), &why))
        fail(why);
    editing.drag_to(placement);
    editor_.frame();
    begun_ = Clock::now();
    editing.end_drag();
    editor_.frame();
}

void Player::point()
{
    PointPlacement to;
    to.place = {number(3), number(4), number(5)};
    if (num_words() == 7)
        to.degrees = number(6);
    if (!(number(2) >= 0.0))
        fail("points count from 0");
    Editing& editing = opened().editing;
    std::string why;
    if (!editing.begin_point_drag(word(1), static_cast<std::size_t>(number(2)), &why))
        fail(why);
    editing.drag_point_to(to);
    editor_.frame();
    begun_ = Clock::now();
    editing.end_drag();
    editor_.frame();
}

void Player::film()
{
    EditorApp& app = editor_.app();
    if (word(1) == "off")
    {
        app.stop_playing();
        editor_.frame();
        return;
    }
    if (!Film::is_in(opened().editing.document()))
        fail("neither rods that carry the model nor flesh: there is nothing to play");
    if (!opened().film)
        app.play();
    const auto frame = static_cast<std::int64_t>(number(1));
    while (opened().film && opened().film->num_made() <= frame &&
           opened().film->is_working())
        editor_.frame();
    if (!opened().film || opened().film->num_made() <= frame || frame < 0)
        fail("the film has no frame " + word(1) +
             (opened().film ? " " + opened().film->error() : ""));
    app.show_film_frame(frame, true);
    editor_.frame();
}

void Player::live()
{
    EditorApp& app = editor_.app();
    if (word(1) == "off")
    {
        app.stop_playing();
        editor_.frame();
        return;
    }
    const double until = number(1);
    if (!app.can_live())
        fail("the scene has no flesh in time");
    if (!opened().live)
        app.live();
    while (opened().live && (!opened().live_shown || opened().live->time() < until))
        editor_.frame();
    if (!opened().live)
        fail("it ended before");
}

void Player::show()
{
    if (word(2) != "on" && word(2) != "off")
        fail("on or off is needed (got " + in_quotes(word(2)) + ")");
    const bool is_on = word(2) == "on";
    ViewOptions& view = editor_.app().view;
    const std::array<std::pair<const char*, bool*>, 8> switches = {
        {{"edges", &view.shows_edges},
         {"faces", &view.shows_faces},
         {"colours", &view.shows_regions},
         {"ghost", &view.shows_ghost},
         {"floor", &view.shows_floor},
         {"dark", &view.is_dark},
         {"keys", &editor_.app().shows_keys},
         {"panel", &editor_.app().panel.is_shown}}};
    const auto* found =
        std::find_if(switches.begin(), switches.end(),
                     [&](const auto& known) { return word(1) == known.first; });
    if (found != switches.end())
        *found->second = is_on;
    else if (word(1) == "cells" || word(1) == "wire")
        view.cells = !is_on               ? CellsShown::No
                     : word(1) == "cells" ? CellsShown::Glass
                                          : CellsShown::Wire;
    else
        fail("nothing is called " + in_quotes(word(1)) +
             " (edges, faces, colours, ghost, floor, cells, wire, dark, keys, panel)");
    editor_.frame();
}

void Player::open()
{
    editor_.app().open(word(1));
    editor_.app().finish_opening();
    editor_.frame();
}

void Player::save()
{
    if (num_words() > 2 && word(2) != "poses")
        fail("nothing but poses can be saved alone (got " + in_quotes(word(2)) + ")");
    opened().editing.document().save(word(1), Overwrite::Yes,
                                     num_words() > 2 ? SavedPart::Poses : SavedPart::All);
    editor_.frame();
}

void Player::export_model()
{
    if (opened().editing.is_unsolved() && !opened().editing.shows_film())
        opened().editing.solve();
    wait();
    opened().editing.export_model(word(1), Overwrite::Yes);
}

void Player::undo()
{
    if (!opened().editing.document().can_undo())
        fail("there is nothing to undo");
    editor_.app().undo();
    editor_.frame();
}

void Player::redo()
{
    if (!opened().editing.document().can_redo())
        fail("there is nothing to redo");
    editor_.app().redo();
    editor_.frame();
}

void Player::recover()
{
    Document& document = opened().editing.document();
    if (word(1) != "yes" && word(1) != "no")
        fail("yes or no is needed (got " + in_quotes(word(1)) + ")");
    if (document.num_recoverable() == 0)
        fail("there is nothing to recover");
    editor_.app().asks_to_recover = false;
    if (word(1) == "yes")
        document.recover();
    else
        document.drop_recoverable();
    editor_.frame();
}

void Player::quit()
{
    has_quit_ = true;
}

PlaybackReport Player::take_report()
{
    report_.width = editor_.window().width();
    report_.height = editor_.window().height();
    report_.renderer = editor_.window().renderer();
    if (OpenedDocument* opened = editor_.app().opened())
    {
        report_.model = opened->editing.document().path();
        report_.samples = opened->editing.document().model()->geometry.samples.size();
    }
    return std::move(report_);
}

} // namespace

std::vector<Statement> read_statements(const std::string& path)
{
    const std::string text = read_file(path);
    std::vector<Statement> statements;
    LineReader reader(text, 0, true);
    for (std::string_view line; reader.next(line);)
    {
        std::istringstream words{std::string(line.substr(0, line.find('#')))};
        Statement statement;
        statement.line = reader.line_number();
        for (std::string word; words >> word;)
            statement.words.push_back(word);
        if (statement.words.empty())
            continue;
        const Known* known = known_statement(statement.words[0]);
        const Where where{path, statement.line, ""};
        if (known == nullptr)
            throw malformed(where, "no statement " + in_quotes(statement.words[0]));
        const std::size_t count = statement.words.size() - 1;
        if (count < known->min_words || count > known->max_words)
            throw malformed(where, std::string("this needs: ") + known->usage);
        statements.push_back(std::move(statement));
    }
    return statements;
}

PlaybackReport play(Editor& editor, const std::string& path,
                    const std::vector<Statement>& statements)
{
    Player player(editor, path);
    editor.frame(); // sizes are known from the first one on
    editor.frame();
    for (const Statement& statement : statements)
    {
        player.run(statement);
        if (player.has_quit())
            break;
    }
    PlaybackReport report = player.take_report();
    editor.app().close();
    return report;
}

std::string statement_help()
{
    std::string help =
        "Statements of --play, one a line, # begins a comment; places are "
        "pixels of the window,\nshares of it (0.5w 0.5h) or of the view in "
        "it (0.5vw 0.5vh):\n";
    for (const Known& known : kKnown)
        help += std::string("  ") + known.usage + "\n";
    return help;
}

} // namespace cellwarp::core
