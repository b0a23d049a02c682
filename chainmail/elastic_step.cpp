// How Elastic goes along a direction: how far, and what becomes of force and energy.
#include <chainmail/elastic.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace palpate::chainmail {

namespace {

constexpr int newtonSteps = 3;        // of a line search: contacts open and close along it
constexpr int maxShortenings = 8;     // of a step that raises the energy
constexpr int maxInParts = 1;         // the same, where a call has only a part of the cycles: each costs an evaluation
constexpr int maxFromAbove = 2;       // the same, where the increment may have led up: then no step is short enough
constexpr double rounding = 1e-6;     // relative: sums of single-precision products are no better
constexpr double minStiffness = 0.1;  // of a direction, in what is expected along the preconditioned residual
constexpr double maxNearness = 10.0;  // of that expectation, bounds
// A tick's steps, in directions; usual are 0.4 to 1.4. Where tissue gives way to next to nothing along one (skin
// that is about to buckle), a longer one throws the contacts off for the sake of little energy.
constexpr double longest = 1.5;
constexpr double unbounded = std::numeric_limits<double>::infinity();

// Where the parabola through the slope at the start and the energy at `alpha` has its lowest point; between a tenth and a
// half of the way, since the energy is none. Source: J. Nocedal, S. Wright, "Numerical Optimization", 2nd ed., section 3.5.
double shorter(double alpha, double slope, double change) noexcept
{
    const double lowest = -0.5 * slope * alpha * alpha / (change - slope * alpha);
    return std::isfinite(lowest) ? std::clamp(lowest / alpha, 0.1, 0.5) * alpha : 0.5 * alpha;
}

}  // namespace

// The last call's increment is the direction that the next step is made conjugate to. Returns what contacts do along it.
Along Elastic::look() noexcept
{
    ValueAt increment(stack_.windows(), Field::d);
    Along contacts;
    for (ContactSite& s : active()) {
        s.p = increment_ * increment(s);
        contacts.add(s, 0.0);
    }
    if (!products_) {
        const auto product = stack_.dots(Field::d, Field::a, Field::e);
        products_ = {stack_.dot(Field::u, Field::a), increment_ * product[0], increment_ * increment_ * product[1]};
    }
    last_ = {Field::d, Field::e, {-(*products_)[1], -(*products_)[2]}};
    return contacts;
}

// How far to go: Newton on the slope of the energy, the tissue's part a parabola, contacts opening and closing on the way.
double Elastic::lineSearch(double slope, double curvature, Along at, int steps) const noexcept
{
    double alpha = 0.0;
    for (int i = 0; i < steps; ++i) {
        at = i > 0 ? contactsAlong(sites(), alpha) : at;
        const double stiffness = curvature + at.curvature;
        const double change = -(slope + alpha * curvature + at.slope) / stiffness;
        if (!(stiffness > 0.0) || !std::isfinite(change)) {
            return 0.0;
        }
        alpha += change;
    }
    return alpha;
}

// How far to go along a direction that the sites know, where the tissue's energy is a parabola. A step after which the
// energy is higher (the contacts' line search is of first order) is shortened. The sites go along; 0: nowhere.
double Elastic::searchParabola(const Direction& to, ElasticResult& result) noexcept
{
    const double start = energy_;
    const double before = start + contactEnergy_;
    const double slope = to.tissue.slope;
    const double steepness = slope + to.contacts.slope;
    double length = lineSearch(slope, to.tissue.curvature, to.contacts, newtonSteps);
    for (int i = 0; length != 0.0; ++i) {
        moveSites(length);
        energy_ = start + to.tissue.at(length);
        const double change = energy_ + contactEnergy_ - before;
        if (change <= rounding * (std::abs(before) + std::abs(historyEnergy_) + std::abs(slope * length))) {
            return length;
        }
        moveSites(-length);
        length = i < maxShortenings ? shorter(length, steepness, change) : 0.0;
        ++result.shortened;
    }
    energy_ = start;
    return 0.0;
}

// Goes on along the last call's increment, whose image is known, as far as lowers the energy. The tissue's force and
// energy go along the parabola: the next step evaluates them, or confirm().
bool Elastic::warmStart(ElasticResult& result) noexcept
{
    const Along contacts = look();
    const double length = searchParabola({Field::d, 0.0, last_.tissue, contacts}, result);
    if (length == 0.0) {
        forgetIncrement();
        return false;
    }
    increment_ *= length;
    stack_.warmStart(increment_);
    products_.reset();
    last_.tissue = last_.tissue.from(length);
    last_.length = length;
    return true;
}

// Evaluates the tissue where warmStart() led. False where that is up: then all is as when the call began.
bool Elastic::confirm(double start) noexcept
{
    energy_ = tissueForce(Field::f, Field::d).energy;
    if (energy_ + contactEnergy_ - start > rounding * (std::abs(start) + std::abs(historyEnergy_))) {
        retreat();
        return false;
    }
    products_ = stack_.keepStep(Field::d, {.length = 0.0F, .keep = static_cast<float>(increment_)});
    increment_ = 1.0;
    return true;
}

// Back to where the call began.
void Elastic::retreat() noexcept
{
    products_.reset();
    stack_.combine(Field::u, -increment_, Field::d, Field::u);
    stack_.combine(Field::a, -increment_, Field::e, Field::a);
    energy_ = startEnergy_;
    ValueAt displacement(stack_.windows(), Field::u);
    touchAll([&](ContactSite& s) {
        const Vec3 u = displacement(s);
        s.slip += s.u - u;
        s.u = u;
        touch(s, shapes_, ties_);
    });
}

// At small strain the tissue's energy is a parabola, and one operator gives its curvature.
bool Elastic::takeLinearStep(Direction to, ElasticResult& result) noexcept
{
    if (to.field == Field::p) {
        stack_.direct(last_.direction, lastInField() * to.beta, 0.0);
    }
    to.tissue.curvature = -stack_.evaluate(to.field, Field::f, to.field, volume::SmallStrain{}).product;
    const double length = searchParabola(to, result);
    if (length != 0.0) {
        keepStep(to, {static_cast<float>(length), 0.0F, static_cast<float>(length), static_cast<float>(length)});
    }
    return length != 0.0;
}

// Goes along a direction that the sites know, as far as lowers the energy. The force is evaluated where the expected
// curvature leads to. The slope there gives the curvature, and where the lowest point is near, force and energy go there
// along the parabola. A step after which the energy is above what it was, and above `limit`, is shortened, and taken back
// at last (the contacts' line search is of first order, and finite strain has no parabola). False: nowhere.
bool Elastic::takeStep(const Direction& to, double limit, ElasticResult& result) noexcept
{
    if (volume::isSmall(options_.law)) {
        return takeLinearStep(to, result);
    }
    const double start = energy_;
    const double before = std::max(limit, start + contactEnergy_);
    const Along& contacts = to.contacts;
    const double slope = to.tissue.slope;
    const double steepness = slope + contacts.slope;
    const int maxTries = course_.effort.inParts ? maxInParts : limit > noLimit ? maxFromAbove : maxShortenings;
    const double most = course_.effort.isTick ? longest : unbounded;
    double length = lineSearch(slope, to.tissue.curvature, contacts, 1);
    double gone = 0.0;
    for (int i = 0, searches = 0; length != 0.0;) {
        if (gone == 0.0 && to.field == Field::p) {
            stack_.direct(last_.direction, lastInField() * to.beta, length);
        } else {
            stack_.combine(Field::u, length - gone, to.field, Field::u);
        }
        gone = length;
        const auto now = tissueForce(Field::f, to.field);
        const Parabola tissue{to.tissue.slope, (-now.product - to.tissue.slope) / gone};
        const double best = std::clamp(lineSearch(slope, tissue.curvature, contacts, newtonSteps), -most, most);
        const double further = std::max(1.0, std::abs(best / gone));
        const double off = std::abs(now.energy - start - tissue.at(gone)) * further * further * further;
        const bool isNear = further <= reach_.further && off <= reach_.off * std::abs(steepness * best);
        if (!isNear && best != 0.0 && searches++ == 0) {
            length = best;
            continue;
        }
        length = isNear ? best : gone;
        moveSites(length);
        energy_ = now.energy + tissue.at(length) - tissue.at(gone);
        const double scale = std::abs(before) + std::abs(historyEnergy_) + std::abs(slope * length);
        const double change = energy_ + contactEnergy_ - before;
        if (change <= rounding * scale) {
            Direction found = to;
            found.tissue = tissue;
            keepStep(found, {static_cast<float>(length / gone), 1.0F, static_cast<float>(length - gone),
                             static_cast<float>(length)});
            return true;
        }
        moveSites(-length);
        length = i++ < maxTries && length != 0.0 ? shorter(length, steepness, change) : 0.0;
        ++result.shortened;
    }
    stack_.combine(Field::u, -gone, to.field, Field::u);
    energy_ = start;
    return false;
}

// d and e become the increment of this call so far: of the last call's what was taken again, and the steps since.
void Elastic::keepStep(const Direction& to, KeptStep step) noexcept
{
    const bool again = to.field == Field::d;
    const double length = static_cast<double>(step.length);
    step.keep = again ? 0.0F : static_cast<float>(increment_);
    products_ = stack_.keepStep(to.field, step);
    increment_ = 1.0;
    stiffness_ = to.tissue.curvature + to.contacts.curvature;
    last_ = {to.field, again ? Field::e : Field::q, to.tissue.from(length), length};
}

// One step of preconditioned conjugate gradients, conjugate to the last: along the correction z of the forces out of
// balance.
bool Elastic::step(double limit, ElasticResult& result) noexcept
{
    double& nearness = nearness_[std::min<std::size_t>(result.cycles, nearness_.size()) - 1];
    const auto product = stack_.dots(Field::z, Field::a, last_.image);
    double own = last_.tissue.curvature;
    double mixed = -increment_ * product[1];
    double work = product[0];  // of the residual along z
    ValueAt correction(stack_.windows(), Field::z);
    for (ContactSite& s : active()) {
        s.p = last_.length != 0.0 ? last_.length * s.p : Vec3(0.0);
        const Vec3 resisted = s.resist(s.p);
        s.z = correction(s);
        own += glm::dot(s.p, resisted);
        mixed += glm::dot(s.z, resisted);
        work += glm::dot(s.z, s.force);
    }
    const double beta = own > 0.0 && std::isfinite(mixed / own) ? -mixed / own : 0.0;
    Direction to{Field::p, beta, {beta * last_.tissue.slope - product[0], 0.0}, {}};
    for (ContactSite& s : active()) {
        s.p = s.z + beta * s.p;
        to.contacts.add(s, 0.0);
    }
    // Along z the stiffness is the work but for how near the preconditioner is, as in the cycle before; made conjugate, it
    // is less by what the increment has of it.
    const double conjugate = -beta * mixed;
    const double contacts = to.contacts.curvature;
    const double expected = std::max(nearness * work - conjugate, minStiffness * nearness * work);
    to.tissue.curvature = std::max(expected - contacts, minStiffness * expected);
    const bool stepped = takeStep(to, limit, result);
    if (const double found = (stiffness_ + conjugate) / work; stepped && std::isfinite(found)) {
        nearness = 0.5 * (nearness + std::clamp(found, 1.0 / maxNearness, maxNearness));
    }
    return stepped;
}

// Steps along the last call's increment. With the tissue's force evaluated it is sure not to go up.
void Elastic::again(ElasticResult& result) noexcept
{
    scaleIncrement();
    const Along contacts = look();
    if (!takeStep({Field::d, 0.0, last_.tissue, contacts}, noLimit, result)) {
        forgetIncrement();
    }
}

// Fields d and e become the increment itself.
void Elastic::scaleIncrement() noexcept
{
    stack_.clear(Field::t);
    stack_.combine(Field::t, increment_, Field::d, Field::d);
    stack_.combine(Field::t, increment_, Field::e, Field::e);
    increment_ = 1.0;
}

void Elastic::forgetIncrement() noexcept
{
    products_.reset();
    increment_ = 1.0;
    stack_.clear(Field::d);
    stack_.clear(Field::e);
    forgetStep();
}

// Springs of 100 kN/m that let go leave a history in tissue that relaxes, with which cells are turned inside out, until
// numbers end. The body goes to rest, without force, and the next call begins there.
void Elastic::startAnew() noexcept
{
    forgetIncrement();
    settle();
    for (const Field f : {Field::p, Field::q, Field::z, Field::f, Field::t}) {
        stack_.clear(f);
    }
}

void Elastic::forgetStep() noexcept
{
    last_ = {};
}

}  // namespace palpate::chainmail
