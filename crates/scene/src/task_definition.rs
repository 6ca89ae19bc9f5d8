//! The stages of a task: its own, or those of a built-in task.

use crate::stages::{BUILTIN_TASKS, BuiltinTask, Definition};
use crate::{Error, Result, Task};

impl Task {
    /// The task's stages and what belongs to them: its own, or those of the built-in task of its
    /// name.
    ///
    /// # Errors
    /// A name without stages.
    pub fn definition(&self) -> Result<Definition> {
        let mut definition = match BuiltinTask::named(self.name) {
            _ if !self.stages.is_empty() => Definition {
                summary: String::new(),
                prompt: String::new(),
                order: self.order,
                stages: self.stages.clone(),
                aborts: Vec::new(),
                script: Vec::new(),
            },
            Some(builtin) => builtin.definition()?,
            None => {
                let names: Vec<&str> = BUILTIN_TASKS.iter().map(|b| b.name.name()).collect();
                return Err(Error::Invalid {
                    file: format!("task '{}'", self.name.name()),
                    reason: format!(
                        "has no stages; write [[task.stage]], or name a built-in task: {}",
                        names.join(", ")
                    ),
                });
            }
        };
        definition.aborts.extend(self.aborts.iter().cloned());
        if !self.script.is_empty() {
            definition.script.clone_from(&self.script);
        }
        if let Some(prompt) = &self.prompt {
            definition.prompt.clone_from(prompt);
        }
        Ok(definition)
    }

    /// The same task with its stages written out: its meaning no longer depends on the program's
    /// built-in tasks.
    ///
    /// # Errors
    /// As [`definition`](Self::definition).
    pub fn written_out(&self) -> Result<Self> {
        let definition = self.definition()?;
        Ok(Self {
            prompt: Some(definition.prompt),
            order: definition.order,
            stages: definition.stages,
            aborts: definition.aborts,
            script: definition.script,
            ..self.clone()
        })
    }
}
