//! What happens between two batches: parts that appear and disappear, motions that start and end, and the run's end.

use super::names::{comment, file_name, lines};
use super::parts::Wall;
use super::template::Templates;
use super::walls::{WallText, change, end_of, start_of};
use crate::backend::liggghts::{Schedule, deck_number};
use crate::geometry::part::{AtRest, Trigger};
use crate::scene::EndConditions;

/// What events need to know.
#[derive(Debug)]
pub struct Events<'a> {
    /// The walls.
    pub text: &'a WallText<'a>,
    /// When things happen.
    pub schedule: Schedule,
    /// Time step of the last batch at which something enters.
    pub last_entry: u64,
    /// The templates.
    pub templates: &'a Templates,
}

impl Events<'_> {
    /// Variables that must be there before the run.
    pub fn variables(&self, end: &EndConditions) -> String {
        let batch = self.schedule.cadence.hand_over;
        let held = |id: &str| format!("variable held_{id} equal -{batch}");
        let waiting = self.text.walls.iter().flat_map(|wall| {
            let triggers = [("appears", wall.part.appears), ("disappears", wall.part.disappears)];
            let resting = triggers.into_iter().filter(|(_, trigger)| matches!(trigger, Trigger::AtRest(_)));
            resting.map(move |(verb, _)| held(&format!("{}_{verb}", wall.id)))
        });
        let carried = self.text.carries().then(|| "variable carried equal 0".to_owned());
        lines(waiting.chain(end.at_rest.map(|_| held("end"))).chain(carried))
    }

    /// What carries parts at the beginning of a batch; samples are `look` time steps apart.
    ///
    /// # Errors
    /// Of templates.
    pub fn carry(&self, look: u64) -> Result<String, String> {
        if !self.text.carries() {
            return Ok(String::new());
        }
        let rest = (look - 1).to_string();
        let hold = self.templates.fill("hold.in", &[])?;
        let set_up = self.templates.fill("set_up.in", &[("label", "put_down")])?;
        let values = [("hold", &*hold), ("put_down", &*self.text.put_down()), ("rest", &*rest), ("set_up", &*set_up)];
        self.templates.fill("carry.in", &values)
    }

    /// Everything between two batches but removals and the end.
    ///
    /// # Errors
    /// Of templates.
    pub fn between_batches(&self) -> Result<String, String> {
        let mut text = String::new();
        for wall in self.text.walls {
            text.push_str(&self.motions(wall));
            // Going before coming: at one look a part does one of the two, the one that it waited for.
            text.push_str(&self.event(wall, wall.part.disappears, false)?);
            text.push_str(&self.event(wall, wall.part.appears, true)?);
        }
        Ok(text)
    }

    fn motions(&self, wall: &Wall<'_>) -> String {
        let mut text = String::new();
        for one in &wall.moves {
            let at = |step: u64, command: String| {
                format!("if \"${{now}} == {step}\" then \"{command}\" \"variable set_up equal 1\"\n")
            };
            if let Some(step) = one.until {
                text.push_str(&at(step, end_of(wall, one)));
            }
            if one.from > 0 {
                text.push_str(&at(one.from, start_of(wall, one)));
            }
        }
        if text.is_empty() { text } else { format!("# {} moves\n{text}", comment(&wall.part.name)) }
    }

    /// A part comes or goes.
    fn event(&self, wall: &Wall<'_>, trigger: Trigger, comes: bool) -> Result<String, String> {
        let verb = if comes { "appears" } else { "disappears" };
        let (id, name) = (&wall.id, &wall.part.name);
        let waits = format!("(v_there_{id}=={})", u8::from(!comes));
        let label = format!("{id}_{verb}_not");
        let (what, condition) = match trigger {
            Trigger::Always | Trigger::Never => return Ok(String::new()),
            Trigger::At { time } => {
                let step = self.schedule.batch_at(time);
                let due = format!(
                    "variable due equal {waits}*(step>={step})\nif \"${{due}} == 0\" then \"jump SELF {label}\""
                );
                (format!("at {} s", deck_number(time)), due)
            }
            Trigger::AtRest(rest) => {
                let watch = format!("{id}_{verb}");
                let condition = self.rest(&rest, &watch, &waits)?;
                let hold = self.hold_steps(&rest);
                let due = format!("{condition}if \"${{held_{watch}}} < {hold}\" then \"jump SELF {label}\"");
                (at_rest(&rest), due)
            }
        };
        let what = format!("{} {verb} {what}", comment(name));
        let change = change(wall, comes, &self.schedule);
        self.templates.fill(
            "event.in",
            &[
                ("what", &what),
                ("condition", &condition),
                ("state", &format!("there_{id}")),
                ("next", if comes { "1" } else { "2" }),
                ("change", &change),
                ("name", &file_name(name)),
                ("present", if comes { "1" } else { "0" }),
                ("label", &label),
            ],
        )
    }

    /// Lines that count for how many time steps the particles have been slow.
    fn rest(&self, rest: &AtRest, id: &str, also: &str) -> Result<String, String> {
        let batch = self.schedule.cadence.hand_over.to_string();
        let earliest = self.schedule.batch_at(rest.not_before);
        // A batch enters after the events of its time step.
        let fed = if self.last_entry == 0 { String::new() } else { format!("*(step>{})", self.last_entry) };
        let slow = format!("(f_rest<{})", deck_number(rest.speed * rest.speed));
        let rests = format!("{slow}*(step>={earliest}){fed}*(count(all)>0)*{also}");
        self.templates.fill("rest.in", &[("rests", &rests), ("id", id), ("batch", &batch)])
    }

    fn hold_steps(&self, rest: &AtRest) -> u64 {
        (rest.hold / self.schedule.timestep - 1e-6).ceil().max(0.0) as u64
    }

    /// The end conditions, the most urgent first.
    ///
    /// # Errors
    /// Of templates.
    pub fn ends(&self, end: &EndConditions) -> Result<String, String> {
        let leave = |condition: &str, reason: &str| {
            format!("if \"{condition}\" then \"variable reason string {reason}\" \"jump SELF last\"\n")
        };
        let mut text = leave(&format!("${{now}} >= {}", self.schedule.steps), "time");
        if end.empty {
            text.push_str(&format!("variable empty equal (count(all)==0)*(step>{})\n", self.last_entry));
            text.push_str(&leave("${empty} == 1", "empty"));
        }
        if let Some(count) = end.left_count {
            text.push_str(&leave(&format!("${{left}} >= {count}"), "count"));
        }
        if let Some(rest) = &end.at_rest {
            text.push_str(&format!("# the run ends {}\n", at_rest(rest)));
            // Parts that wait for rest go first: a gate that has just opened must be given time to act.
            let resting = self.text.walls.iter().flat_map(|wall| {
                let triggers = [(wall.part.appears, 0), (wall.part.disappears, 1)];
                let waiting = triggers.into_iter().filter(|(trigger, _)| matches!(trigger, Trigger::AtRest(_)));
                waiting.map(move |(_, state)| format!("(v_there_{}!={state})", wall.id))
            });
            let none_waits: Vec<String> = resting.collect();
            let also = if none_waits.is_empty() { "1".to_owned() } else { none_waits.join("*") };
            text.push_str(&self.rest(rest, "end", &also)?);
            text.push_str(&leave(&format!("${{held_end}} >= {}", self.hold_steps(rest)), "rest"));
        }
        Ok(text)
    }
}

fn at_rest(rest: &AtRest) -> String {
    let [speed, hold, earliest] = [rest.speed, rest.hold, rest.not_before].map(deck_number);
    format!("once at rest: root-mean-square speed below {speed} m/s for {hold} s, not before {earliest} s")
}
